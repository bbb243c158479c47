//! Scenarios, reports and the farside command.
