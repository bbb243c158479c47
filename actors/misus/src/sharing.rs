//! The actors that share goals: the [`Coordinator`], which wraps a [`Centre`](crate::shac::Centre), and
//! on each rover a [`Pursuer`], which wraps an [`Owner`](crate::shac::Owner). They give the machines
//! the kernel's time, timers, durable memory and links; everything written is a state sample. What
//! to do with goals is decided by a [`TeamMind`] and by [`RoverMind`]s.

mod coordinator;
mod post;
mod pursuer;

pub use coordinator::{Coordinator, TeamMind, TeamMove};
pub use post::{Names, SharingDue};
pub use pursuer::{Pursuer, RoverMind, RoverMove};
