//! The actors that share goals: the [`Coordinator`], which wraps a [`Centre`](crate::shac::Centre), and
//! on each rover a [`Pursuer`], which wraps an [`Owner`](crate::shac::Owner). They give the machines
//! the kernel's time, timers, durable memory and links; everything written is a state sample. What
//! to do with goals is decided by a [`TeamMind`] and by [`RoverMind`]s. An actor that does more than
//! own or hand out goals has the seat of the owner (`seat.rs`) or of the centre (`centre_seat.rs`) in it, as
//! those of the closed loop do.

mod centre_seat;
mod coordinator;
mod post;
mod pursuer;
mod seat;

pub(crate) use centre_seat::CentreSeat;
pub use centre_seat::{TeamMind, TeamMove};
pub use coordinator::Coordinator;
pub(crate) use post::receives;
pub use post::{Names, SharingDue};
pub use pursuer::Pursuer;
pub(crate) use seat::OwnerSeat;
pub use seat::{RoverMind, RoverMove};
