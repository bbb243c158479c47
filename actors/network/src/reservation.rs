//! The `complete` policy: no rover enters before a path through time to its exit is reserved for
//! it.
//!
//! # A reservation request
//!
//! Each node has a **reservation table**: for each of its vertices the planned visits, in order.
//! The node at whose entry a rover waits sends probes along a few routes, each a sequence of
//! neighbouring nodes (`routes`). Each node on a route works out where in its own part of the
//! roadmap the rover could be and when, from its own table alone ([`crate::mapf::safe_intervals`]),
//! and passes that on. The owner of the goal picks the earliest arrival of all routes and sends
//! that timed path back; each node enters its part in its table, tentatively. When the first node
//! has entered its part, the path is reserved, irrevocably, and a confirmation runs forward. The
//! next rover of the queue follows.
//!
//! Requests of several rovers are under way at the same time. Conflicts are settled by age, as
//! *wait-die* settles those of transactions in databases (Rosenkrantz, Stearns and Lewis, 1978).
//! Where a part cannot be entered because it would meet a visit that is confirmed, or that of an
//! older request, the request fails: what it entered is struck out, and it is tried again, as old
//! as it was. Where it would meet only visits of younger requests, it waits until they are
//! confirmed or struck out.
//!
//! # Execution
//!
//! Order drives execution, not the clock: a vertex is granted to the rover whose visit is the first
//! in its table, once the rover before has gone on and the visit is confirmed. Grants, departures
//! and all else that keeps rovers apart are those of the safety protocol.
//!
//! # Why no team of queued rovers can come to a deadlock
//!
//! *A request ends.* Waiting goes from older to younger requests only, so there is no cycle of
//! requests that wait for each other. A request that fails does so because another one was
//! confirmed or is older. The oldest fails only because others were confirmed since it began, and
//! there are finitely many. And there is always a way to find: after the last planned visit all
//! vertices are free for ever, rovers vanish at their goals, and one that waits in a queue is in
//! nobody's way.
//!
//! *A reserved path is driven to its end.* Let each planned visit that has not begun wait for two
//! things: that its rover's visit before it has begun, and that the visit before it in the table
//! has ended, which is when that rover's next visit has begun. Both began earlier in planned time,
//! the second because visits in one table lie apart. So of all visits that have not begun the one
//! with the earliest planned time waits for nothing but messages, and those are repeated until they
//! are heard. This holds however late the team is, because planned times are never changed.
//!
//! *Coverage gaps change nothing of that.* Nobody hears a rover that crosses a gap in the coverage
//! ([`Gaps`](super::Gaps)), so it sets out into one only with all grants for the crossing. That is
//! one claim, of all its vertices and the covered one beyond, and all these visits begin in planned
//! time when it sets out. So the whole claim waits for visits that began earlier: its rover's one
//! before it, and at each of its vertices the one before it in the table, which ends when that
//! rover goes on. From a vertex in a gap it goes on without waiting for anything, and it is heard
//! when it has come out. And there is still a way to find: a shortest way through covered vertices
//! and gaps, which a request looks along first, has each crossing lead from one covered vertex to
//! another, past no vertex twice.
//!
//! *Nor does the loss of a node.* Whoever takes over for it (`network.failover_after`) has the same
//! paths in its table, in the same order: see [`failover`](super::NetworkConfig::failover_after).
//!
//! All this needs links that lose less than all, and nodes and rovers that come back: what they
//! keep is durable.
//!
//! # Rovers that stay on the map
//!
//! On maps where rovers stand from the start and stay at their goals, the last visit of each has no
//! end, and "there is always a way to find" needs another reason.
//!
//! *Well-formed instances.* There each rover has a **clear path**: one past no start and no goal of
//! any other rover (Cap, Vokrinek and Kleiner, 2015). A rover stands at its start until its whole
//! path is reserved, so at any time each rover stands at its start, or has a path to its goal that
//! is reserved to its end. Nobody is ever asked to step aside. So after the last planned visit that
//! ends, all vertices but starts and goals are free for ever; and so is the goal of a rover that
//! has no path yet, since nobody else stays there. Its clear path is then free, and until then it
//! can wait where it stands.
//!
//! The request must find that path, however the map is divided among nodes. The routes that it
//! tries first are those of the empty map, and a rover that is parked on all of them stops it
//! there. When they lead nowhere, it follows the clear path itself: through the nodes whose
//! vertices that passes, and each hands on, whatever else it hands on, the earliest label that
//! lasts for ever at the vertex at which the clear path leaves its region. By induction over the
//! regions there is one: the clear path's part in a region leads from a vertex at which the rover
//! may be for ever from some time on, through vertices that are free for ever from some time on.
//! All nodes know all missions, as they know the roadmap. So a request ends as above, and
//! **on a well-formed instance all arrive, whatever the number of nodes**.
//!
//! *Other instances.* There a rover may have to move that has nowhere to go itself. What becomes of
//! them is the affair of a joint resolution (`registry/joint.rs`): one node gathers what is
//! reserved and plans for all. If all can get to their goals at all, they do, as long as the search
//! finds how: it is complete, but for a limit on its expansions. Where there is none, or it finds
//! none, and with `network.failover_after`, rovers make room one for another, the older request
//! first (`registry/displacement.rs`), which guarantees nothing.

mod atlas;
pub(crate) mod config;
pub mod messages;
mod registries;
mod registry;
mod relay;
mod routes;
mod table;
mod timed_paths;

pub(crate) use atlas::Atlas;
pub(crate) use registries::Registries;
pub(crate) use registry::{Desk, Registry};
pub(crate) use relay::Receipt;
pub(crate) use timed_paths::TimedPaths;
