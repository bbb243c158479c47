//! The `farside` command as a user meets it: what it prints where, and how it exits.

mod common;
mod contacts;
mod ink;
mod logs;
mod outputs;
mod pictures;
mod report;
mod running;
mod scenarios;
mod snapshots;
mod studies;
mod traffic;
