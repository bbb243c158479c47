//! What helps the policy `max-plus` out of deadlocks, each behind a key of its own: entry gates,
//! probes of who waits for whom, and resolution at junctions. What nodes do is in `node::max_plus`.
//!
//! An aid that was tried made things worse: a token for each corridor (a chain of vertices where
//! two rovers cannot pass each other), which opened it in one direction at a time. More teams of 100
//! rovers deadlocked with it than without. Beyond a corridor there are only single junctions and
//! other corridors. So a rover that waits for a token waits in somebody's way, and the detours that
//! would clear it need tokens too. What would help is to grant a corridor together with everything
//! beyond it, up to the goal, and that is what the policy `complete` does. A penalty in place of a
//! barrier was worse still: every team deadlocked, the sooner the higher it was.

pub(crate) mod messages;
