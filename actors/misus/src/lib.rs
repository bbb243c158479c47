//! The multi-rover integrated science understanding system (MISUS): rovers that learn which rocks
//! lie on the ground, and choose by that what to look at next.
//!
//! After T. Estlin, D. Gaines, F. Fisher and R. Castano, "Coordinating Multiple Rovers with
//! Interdependent Science Objectives", AAMAS 2005.

pub mod analysis;
