//! The `farside` command as a user meets it: what it prints where, and how it exits.

mod accounts;
mod browser;
mod cluster;
mod common;
mod contacts;
mod every_output;
mod guide;
mod ink;
mod layouts;
mod logs;
mod outputs;
mod pages;
mod pictures;
mod plan;
mod problem;
mod reading;
mod replays;
mod report;
mod running;
mod scenarios;
mod schemas;
mod seams;
mod snapshots;
mod studies;
mod ties;
mod traffic;
