//! Who pursues which goal, agreed over links that lose, repeat and reorder messages, between actors
//! that crash: the shared activities of MISUS.
//!
//! After B. Clement and A. Barrett, "Continual Coordination through Shared Activities", AAMAS 2003,
//! which MISUS uses for its goals (T. Estlin et al., AAMAS 2005, section 3.2): an activity that
//! several planners share has roles, parameters, permissions that say who may set which parameter,
//! and a protocol. All of these are data here, see [`Definitions`].
//!
//! There are two roles. The [`Centre`] hands goals out and takes them back; an [`Owner`] on each rover
//! accepts, refuses, releases and carries out. Both are state machines that are given the time:
//! they hold no clock, no planner and no link. Each call returns an [`Output`]: what to write to
//! durable memory, and what to send once that is written. What a planner decides comes in by method
//! calls.
//!
//! # What is kept, whatever the links do
//!
//! - At most one rover holds an unexpired lease of a goal.
//! - Every goal is owned, pooled, achieved, or declared unachievable with a reason.
//! - Outcomes form a set that only grows and that everyone passes on: after a full exchange all sets
//!   are equal, and a goal that was achieved twice has both records and counts once.
//! - An activity starts only within its lease, and half of a joint goal only if another rover
//!   is bound to the other half.
//!
//! # The rules
//!
//! 1. What is decided is written before it is sent, and sent until it is acknowledged.
//! 2. An assignment is accepted only if it is newer, by term and epoch; an old one is answered with the
//!    present state.
//! 3. A status is cumulative, and has a version; the highest wins.
//! 4. A release is irrevocable, forbidden after the start, and repeated in each status until it is
//!    acknowledged.
//! 5. The centre takes a release of the present epoch only, and then assigns the goal anew under the
//!    next. A goal that all have refused is pooled; a refusal holds until its rover's capacity changes
//!    or a sol begins.
//! 6. A goal is taken away only by a cancellation that was acknowledged as "not started", or at the
//!    lease's end and a guard.
//! 7. A start is written before the activity starts, and allowed only if it ends within the lease.
//! 8. Outcomes join a set that only grows.
//! 9. Who learns that a goal is achieved drops it, unless it has started: then it finishes, and marks
//!    its outcome as a duplicate.
//! 10. On contact, restart and election digests are exchanged. Of two grants the one of the larger
//!     term and epoch holds; outcomes unite; a new centre waits out leases that it may not know.
//!
//! To these is added what terms alone do not give. An old centre that nobody can reach goes on
//! granting leases that its successor knows nothing of. So with elections a centre needs a *mandate*,
//! the promises of a majority of rovers to support no other term before an instant, and grants
//! nothing without it. Rovers grant the next term only after that instant.
//!
//! ```
//! use farside::{SimDuration, SimTime};
//! use farside_misus::shac::{
//!     Centre, CentreDurable, GoalKey, Owner, OwnerDurable, Party, Settings, SharedGoal, Standing,
//! };
//! use std::sync::Arc;
//!
//! let settings = Arc::new(Settings::new("lease", 2, &[0])?);
//! let mut now = SimTime::ZERO;
//! let (mut centre, _) = Centre::start(settings.clone(), 0, CentreDurable::default(), now);
//! let (mut owner, _) = Owner::start(settings.clone(), 1, OwnerDurable::default(), now);
//!
//! let goal = SharedGoal::new(GoalKey::Numbered(7), [12.0, 3.0], SimDuration::from_secs(600));
//! centre.add(now, goal)?;
//! // The central planner chooses rover 1 among the candidates of a vacancy.
//! assert_eq!(centre.vacancies(now)[0].candidates, [0, 1]);
//! let granted = centre.assign(now, goal.key, &[1])?;
//! for (_, message) in granted.sends.iter().filter(|(to, _)| *to == Party::Owner(1)) {
//!     owner.receive(now, message);
//! }
//! // The rover's planner accepts, starts and ends it.
//! owner.accept(now, goal.key)?;
//! owner.begin(now, goal.key)?;
//! now = now + SimDuration::from_secs(600);
//! let done = owner.done(now, goal.key)?;
//! for (_, message) in done.sends.iter().filter(|(to, _)| *to == Party::Centre(0)) {
//!     centre.receive(now, message);
//! }
//! assert_eq!(centre.standing(goal.key), Some(Standing::Achieved));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod calendar;
mod centre;
mod contact;
mod definition;
mod messages;
mod outcomes;
mod owner;
mod record;
mod settings;
mod values;

pub use calendar::{Calendar, CalendarError};
pub use centre::{AssignError, Centre, CentreDurable, CentreWrite, Office, Vacancy, WishError};
pub use definition::{
    Chooser, DefinitionError, Definitions, Parameter, Permission, Protocol, Reassign, Role,
    SharedActivity, Stage,
};
pub use messages::{
    Acknowledged, AssignTerms, Closed, GoalAck, GoalAssign, GoalCancel, GoalDigest, GoalOutcome,
    GoalRelease, GoalStatus, Held, HoldingState, Message, Output, Support,
};
pub use outcomes::{Outcome, Outcomes};
pub use owner::{
    BidCall, Closing, Holding, Offer, Owner, OwnerDurable, OwnerError, OwnerWrite, Promise,
    TeamStatus,
};
pub use record::{GoalRecord, Holder, Refusal, Standing};
pub use settings::{Rules, Settings, SettingsError};
pub use values::{
    GoalKey, Grant, Parameters, Party, Reason, Revision, SharedGoal, Term, Version, Wish,
};
