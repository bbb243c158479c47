//! The progress bar: an observer that shows the virtual clock on a terminal.

use std::io::IsTerminal;

use farside::record::{Flow, Observer, ObserverError, Record};
use farside::{Report, SimDuration, Simulation};
use indicatif::{ProgressBar, ProgressStyle};

/// How many records pass between two looks at the bar: it must not cost the run anything.
const STRIDE: u32 = 1024;

struct Progress {
    bar: ProgressBar,
    countdown: u32,
}

/// Shows how far the run is, if stderr is a terminal.
pub(super) fn show(sim: &mut Simulation, until: Option<SimDuration>) {
    if !std::io::stderr().is_terminal() {
        return;
    }
    // Most runs end long before `until`, so the bar has no honest length to fill.
    let bar = ProgressBar::new_spinner();
    let template = "{spinner} virtual time {msg}, wall time {elapsed}";
    // A template that is a constant is valid, or was never seen working.
    let style = ProgressStyle::with_template(template);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    if let Some(until) = until {
        bar.set_prefix(until.to_string());
    }
    sim.observe(Progress { bar, countdown: 1 });
}

impl Observer for Progress {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        self.countdown -= 1;
        if self.countdown == 0 {
            self.countdown = STRIDE;
            let now_s = record.time().as_secs_f64();
            self.bar.set_message(format!("{now_s:.1} s"));
            self.bar.tick();
        }
        Ok(Flow::Continue)
    }

    fn end(&mut self, _report: &Report) -> Result<(), ObserverError> {
        self.bar.finish_and_clear();
        Ok(())
    }
}
