//! The Farside kernel.
