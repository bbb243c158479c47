//! The progress bar: an observer that shows on a terminal how far a run is.

use std::io::IsTerminal;

use farside::record::{Flow, Observer, ObserverError, Record, RecordClass};
use farside::{Report, SimDuration, Simulation};
use indicatif::{HumanCount, ProgressBar, ProgressDrawTarget, ProgressStyle};

use farside_actors::system::Goal;

/// How many records pass between two looks at the bar: it must not cost the run anything.
const STRIDE: u32 = 1024;

/// Drawings a second; more is unreadable.
const DRAWINGS_HZ: u8 = 10;

struct Progress {
    bar: ProgressBar,
    /// What fills the bar; without one it is the virtual time.
    goal: Option<Goal>,
    countdown: u32,
    events: u64,
}

/// Shows how far the run is, if stderr is a terminal. The bar fills with what the system wants to
/// achieve; without such a goal, with the virtual time up to `until`; without that it only spins.
pub(super) fn show(sim: &mut Simulation, goal: Option<Goal>, until: Option<SimDuration>) {
    if !std::io::stderr().is_terminal() {
        return;
    }
    let length = match (&goal, until) {
        (Some(goal), _) => Some(goal.of),
        (None, Some(until)) => Some(until.as_nanos()),
        (None, None) => None,
    };
    let target = ProgressDrawTarget::stderr_with_hz(DRAWINGS_HZ);
    let bar = ProgressBar::with_draw_target(length, target);
    let template = match (&goal, length) {
        (Some(_), _) => "{wide_bar} {pos} of {len} {prefix}, {msg}",
        (None, Some(_)) => "{wide_bar} {percent} %, {msg}",
        (None, None) => "{spinner} {msg}",
    };
    // A template that is a constant is valid, or was never seen working.
    let style = ProgressStyle::with_template(template);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    if let Some(goal) = &goal {
        bar.set_prefix(goal.what);
    }
    sim.observe(Progress {
        bar,
        goal,
        countdown: 1,
        events: 0,
    });
}

impl Progress {
    fn draw(&mut self, record: &Record<'_>) {
        let time = record.time();
        let wall_s = self.bar.elapsed().as_secs_f64();
        // Too little time to tell a rate from noise shows as zero, for a tenth of a second.
        let rate = if wall_s > 0.1 {
            self.events as f64 / wall_s
        } else {
            0.0
        };
        self.bar.set_message(format!(
            "{:.1} s, {} events, {}/s",
            time.as_secs_f64(),
            HumanCount(self.events),
            HumanCount(rate as u64)
        ));
        match &self.goal {
            Some(goal) => self.bar.set_position((goal.done)()),
            None => self.bar.set_position(time.as_nanos()),
        }
        // A position that stays the same is drawn too: the clock goes on.
        self.bar.tick();
    }
}

impl Observer for Progress {
    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let of_a_message = matches!(record.class, RecordClass::Lost | RecordClass::InFlight);
        self.events += u64::from(!of_a_message && record.class != RecordClass::Sample);
        self.countdown -= 1;
        if self.countdown == 0 {
            self.countdown = STRIDE;
            self.draw(record);
        }
        Ok(Flow::Continue)
    }

    fn end(&mut self, _report: &Report) -> Result<(), ObserverError> {
        self.bar.finish_and_clear();
        Ok(())
    }
}
