//! The actors that share goals: the [`Coordinator`], which wraps a [`Centre`](crate::shac::Centre), and
//! on each rover a [`Pursuer`], which wraps an [`Owner`](crate::shac::Owner). They give the machines
//! the kernel's time, timers, durable memory and links; everything written is a state sample. What
//! to do with goals is decided by a [`TeamMind`] and by [`RoverMind`]s. An actor that does more than
//! own goals has the seat of the owner (`seat.rs`) in it, as the explorer of the closed loop does.

mod coordinator;
mod post;
mod pursuer;
mod seat;

pub use coordinator::{Coordinator, TeamMind, TeamMove};
pub(crate) use post::receives;
pub use post::{Names, SharingDue};
pub use pursuer::Pursuer;
pub(crate) use seat::OwnerSeat;
pub use seat::{RoverMind, RoverMove};
