//! Ctrl-C and termination: end the run after the event in hand, so that the log is whole.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Raises `flag` at the first Ctrl-C, SIGTERM or SIGHUP; the second one ends the process at once.
pub(super) fn raise_on_interrupt(flag: Arc<AtomicBool>) {
    on_interrupt(move || flag.store(true, Ordering::SeqCst));
}

/// Does `work` at the first Ctrl-C, SIGTERM or SIGHUP; the second one ends the process at once.
pub(super) fn on_interrupt(work: impl Fn() + Send + 'static) {
    let raised = AtomicBool::new(false);
    let handled = ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::SeqCst) {
            // What the shell reports for a process that Ctrl-C killed.
            std::process::exit(130);
        }
        work();
    });
    if let Err(error) = handled {
        tracing::warn!("Ctrl-C will end the process at once: {error}");
    }
}
