//! What helps the policy `max-plus` out of deadlocks, each behind a key of its own.

pub(crate) mod messages;
