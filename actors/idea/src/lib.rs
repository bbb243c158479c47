//! The Intelligent Distributed Execution Architecture (IDEA): agents of one structure, each of which
//! plans what to do within a latency that it never exceeds.
//!
//! After M. B. Dias, S. Lemai and N. Muscettola, "A Real-Time Rover Executive Based On Model-Based
//! Reactive Planning", i-SAIRAS 2003. Section 2 of it is the agent; section 3 the K9 rover, which two
//! agents control.

pub mod agent;
mod assemble;
mod builtin;
pub mod config;
pub mod deliberate;
pub mod deliberator;
mod ground;
pub mod metrics;
pub mod mission;
pub mod models;
mod monitor;
mod outcomes;
mod picture;
pub mod records;
pub mod register;
pub mod relay;
pub mod runner;
mod scene;
pub mod service;
mod system;
pub mod wording;

pub use metrics::IdeaMetrics;
pub use system::IdeaSystem;
