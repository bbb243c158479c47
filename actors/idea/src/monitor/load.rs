//! How busy an agent is over time: Figures 6 and 7 of the paper, in bins of equal length, with the
//! causes of the dearest cycles.

use farside::{SimDuration, SimTime};

use crate::records::{AgentCycle, TimelineSays};

/// The most peaks that are kept.
const PEAKS: usize = 12;

/// Why a cycle took more than others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cause {
    /// Nothing in particular.
    None,
    /// The next command of a goal, or the next goal of a plan, was given.
    Command,
    /// A goal was received.
    Goal,
    /// A goal was expanded into commands.
    Expanded,
    /// There was an alarm.
    Alarm,
}

impl Cause {
    /// Why the cycle was dear in which a timeline of the K9's models began to say something.
    pub(crate) fn of(says: &TimelineSays) -> Cause {
        match says.timeline.as_str() {
            "MotionHealth_SV" if says.is_alarm() => Cause::Alarm,
            "MotionMonitor_SV" => match says.says.as_str() {
                "Nominal" => Cause::None,
                _ => Cause::Alarm,
            },
            "Location_SV" if says.says.starts_with("DriveTo") => Cause::Expanded,
            "Goal_SV" if says.says.starts_with("ImageAt") => Cause::Command,
            "PanTilt_SV" if says.says.starts_with("Point") => Cause::Command,
            "Camera_SV" if says.says.starts_with("TakeImage") => Cause::Command,
            _ => Cause::None,
        }
    }

    /// What it is called.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Cause::None => "nothing in particular",
            Cause::Command => "next command",
            Cause::Goal => "goal received",
            Cause::Expanded => "goal expanded",
            Cause::Alarm => "alarm",
        }
    }
}

/// A cycle that took much.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Peak {
    pub(crate) at: SimTime,
    pub(crate) operations: u64,
    pub(crate) cause: Cause,
}

/// The cycles of a bin.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bin {
    pub(crate) cycles: u32,
    /// How long they may take, all together.
    pub(crate) span_ns: u64,
    pub(crate) busy_ns: u64,
    pub(crate) deliberating_ns: u64,
    pub(crate) longest_ns: u64,
    /// The most operations of a cycle.
    pub(crate) most: u64,
    pub(crate) tokens: u32,
}

/// How busy an agent is.
#[derive(Debug, Default)]
pub(crate) struct Load {
    bin: SimDuration,
    pub(crate) bins: Vec<Bin>,
    /// The dearest cycles, the dearest first.
    pub(crate) peaks: Vec<Peak>,
    /// The last cause that was told, and when.
    cause: Option<(Cause, SimTime)>,
}

impl Load {
    /// In bins of this length.
    pub(crate) fn new(bin: SimDuration) -> Self {
        Load {
            bin,
            ..Load::default()
        }
    }

    /// How long a bin is.
    pub(crate) fn bin(&self) -> SimDuration {
        self.bin
    }

    /// Adds a cycle.
    pub(crate) fn cycle(&mut self, cycle: &AgentCycle, at: SimTime, latency: SimDuration) {
        let place = at.as_nanos() / self.bin.as_nanos().max(1);
        let place = usize::try_from(place).unwrap_or(usize::MAX).min(1 << 16);
        if self.bins.len() <= place {
            self.bins.resize(place + 1, Bin::default());
        }
        let latency_ns = latency.as_nanos();
        let busy_ns = cycle.cost_ns.min(latency_ns);
        let bin = &mut self.bins[place];
        bin.cycles += 1;
        bin.span_ns += latency_ns;
        bin.busy_ns += busy_ns;
        // What an operation takes then, for deliberation in the rest of the latency.
        let each = cycle.cost_ns / cycle.operations.max(1);
        let rest_ns = latency_ns - busy_ns;
        bin.deliberating_ns += each.saturating_mul(cycle.deliberation).min(rest_ns);
        bin.longest_ns = bin.longest_ns.max(cycle.cost_ns);
        bin.most = bin.most.max(cycle.operations);
        bin.tokens = bin.tokens.max(cycle.tokens);
        let cause = match cycle.goals {
            0 => Cause::None,
            _ => Cause::Goal,
        };
        self.peak(Peak {
            at,
            operations: cycle.operations,
            cause,
        });
    }

    fn peak(&mut self, peak: Peak) {
        let place = self
            .peaks
            .partition_point(|one| one.operations >= peak.operations);
        if place < PEAKS {
            self.peaks.insert(place, peak);
            self.peaks.truncate(PEAKS);
        }
        self.apply();
    }

    /// What happened in the cycle of this time: it is told after the cycle itself.
    pub(super) fn cause(&mut self, cause: Cause, at: SimTime) {
        let before = self.cause.filter(|(_, when)| *when == at);
        let cause = before.map_or(cause, |(before, _)| before.max(cause));
        self.cause = Some((cause, at));
        self.apply();
    }

    fn apply(&mut self) {
        if let Some((cause, at)) = self.cause
            && let Some(peak) = self.peaks.iter_mut().find(|peak| peak.at == at)
        {
            peak.cause = peak.cause.max(cause);
        }
    }
}
