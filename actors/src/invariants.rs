//! What must never happen, as parts that watch any scenario: collisions, and deadlocks with the
//! circle of those who wait for each other. They know no rover, no node and no protocol: only what
//! actors record of themselves, so that they can find fault with all of these.
//!
//! Two parts are pure, and used where a state is at hand: [`Collisions`] keeps claims on the
//! vertices and edges of a graph, [`WaitGraph`] keeps who waits for whom and finds the circles. Two
//! are observers of a simulation made of them: [`CollisionMonitor`] and [`DeadlockMonitor`] read
//! the state samples of a user's own actors with a closure.
//!
//! # A run of one's own, watched
//!
//! Two carts on one track, each of which wants to go where the other one stands:
//!
//! ```
//! use farside::prelude::*;
//! use farside_actors::invariants::{CollisionMonitor, DeadlockMonitor, Place, Seen, Waits};
//! use serde::{Deserialize, Serialize};
//!
//! /// What a cart records of itself.
//! #[derive(Serialize, Deserialize)]
//! struct CartState {
//!     at: u32,
//!     wants: u32,
//! }
//!
//! struct Cart(CartState);
//!
//! impl Actor for Cart {
//!     type Accepts = (Look,);
//!
//!     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
//!         ctx.sample(&self.0);
//!         ctx.timer(SimDuration::from_secs(1), Look);
//!         Ok(())
//!     }
//! }
//!
//! /// It looks again and again, and nothing changes.
//! #[derive(Serialize, Deserialize)]
//! struct Look;
//!
//! impl Handler<Look> for Cart {
//!     fn handle(&mut self, _look: Look, ctx: &mut Context<'_, Self>) -> Outcome {
//!         ctx.timer(SimDuration::from_secs(1), Look);
//!         Ok(())
//!     }
//! }
//!
//! let mut sim = Simulation::new(1);
//! for (name, at, wants) in [("cart_a", 3, 4), ("cart_b", 4, 3)] {
//!     let host = sim.host(name);
//!     sim.actor(host, name, move |_| Cart(CartState { at, wants }));
//! }
//! let (monitor, collisions) = CollisionMonitor::new(|_, cart: &CartState| Place::At(cart.at));
//! sim.observe(monitor);
//! let window = SimDuration::from_secs(20);
//! let (monitor, deadlocks) = DeadlockMonitor::new(window, |_, cart: &CartState| Seen {
//!     place: Place::At(cart.at),
//!     waits: Waits::ForVertex(cart.wants),
//!     done: false,
//! });
//! sim.observe(monitor.that_stops());
//! let report = sim.run(Executor::Inline).unwrap();
//!
//! assert_eq!(collisions.get().count(), 0);
//! let circle = "cart_a at 3 waits for cart_b at 4, which waits for cart_a";
//! assert_eq!(deadlocks.get()[0].cycles[0].to_string(), circle);
//! assert_eq!(report.end.detail(), format!("@control: deadlock since 0s: {circle}"));
//! ```
//!
//! `actors/examples/own_monitor.rs` is a longer one, with a collision in it.

mod collisions;
mod observe;
mod waits;

pub use collisions::{Collision, Collisions, Contested, NAMED_COLLISIONS, Place};
pub use observe::{CollisionMonitor, DeadlockMonitor, DeadlockReport, Handle, Seen, Waits};
pub use waits::{WaitCycle, WaitGraph, Waiter};
