//! The tests that cross crates, one module for each behaviour.

mod cases;
mod claims;
mod contacts;
mod coupling;
mod determinism;
mod end_of_time;
mod foreign_ids;
mod forks;
mod golden;
mod house;
mod layering;
mod misus;
mod network_complete;
mod network_deadlock;
mod network_maps;
mod network_planning;
mod network_safety;
mod network_team;
mod outside;
mod panics;
mod replay;
mod scale;
mod scenarios;
mod seams;
mod verdicts;
mod windows;
