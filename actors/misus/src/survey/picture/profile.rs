//! What a rover has over time, as it was and as its plans predicted it.

use farside_actors::figure::scale::Scale;
use farside_actors::figure::svg::{Area, Frame, Px, path};
use maud::{Markup, html};

use super::history::{Level, RoverHistory};
use crate::survey::messages::{PlanMade, PlannedActivity};

/// How many plans' predictions are drawn in a span.
const PREDICTIONS: u64 = 8;
/// The width in which levels are drawn as one, in pixels.
const COLUMN: f64 = 1.0;

/// A resource.
pub(super) struct Resource {
    pub(super) label: &'static str,
    series: usize,
    level: fn(&Level) -> f64,
    predicted: fn(&PlannedActivity) -> f64,
    /// What may not be passed, and what it is called.
    bound: fn(&PlanMade) -> f64,
    bound_name: &'static str,
}

/// The battery, in watt-hours.
pub(super) const BATTERY: Resource = Resource {
    label: "battery [Wh]",
    series: 0,
    level: |level| level.battery_j / 3600.0,
    predicted: |planned| planned.battery_j / 3600.0,
    bound: |plan| plan.reserve_j / 3600.0,
    bound_name: "reserve",
};

/// Memory, in megabits.
pub(super) const MEMORY: Resource = Resource {
    label: "memory [Mbit]",
    series: 2,
    level: |level| level.memory_bits / 1e6,
    predicted: |planned| planned.memory_bits as f64 / 1e6,
    bound: |plan| plan.memory_size_bits as f64 / 1e6,
    bound_name: "size",
};

impl Resource {
    /// The curves of a rover in an area whose sides are two instants.
    pub(super) fn draw(&self, rover: &RoverHistory, span_ns: (u64, u64), area: Area) -> Markup {
        let (from_ns, to_ns) = span_ns;
        let levels = rover.levels.iter();
        let levels: Vec<&Level> = levels
            .filter(|level| (from_ns..=to_ns).contains(&level.time_ns))
            .collect();
        let predictions = self.predictions(rover, span_ns);
        let bound = rover.plans.last().map(|(_, plan)| (self.bound)(plan));
        let values = levels.iter().map(|level| (self.level)(level));
        let predicted = predictions.iter().flatten().map(|(_, value)| *value);
        // A size that is far from being reached would hide all else.
        let most = values.clone().chain(predicted.clone()).fold(0.0, f64::max);
        let bound = bound.filter(|bound| *bound <= 3.0 * most);
        let scale = Scale::measured(values.chain(predicted).chain(bound).chain([0.0]));
        let frame = Frame {
            area,
            x_label: "",
            x_ticks: Vec::new(),
            y_label: String::new(),
            y_ticks: scale.ticks(3.0),
        };
        let px = |(at_ns, value): (u64, f64)| {
            let x = area.x((at_ns - from_ns) as f64 / (to_ns - from_ns) as f64);
            (x, area.y(scale.place(value)))
        };
        let mut column = f64::NEG_INFINITY;
        let line = levels
            .iter()
            .map(|level| px((level.time_ns, (self.level)(level))));
        let line = line.filter(|(x, _)| {
            let is_next = x - column >= COLUMN;
            column = if is_next { *x } else { column };
            is_next
        });
        html! {
            (frame.draw())
            text class="lane" x=(Px(area.left - 44.0)) y=(Px(area.top + 0.5 * area.height + 4.5))
                text-anchor="end" { (self.label) }
            @if let Some(bound) = bound {
                @let y = area.y(scale.place(bound));
                path class="bound" d=(path([(area.left, y), (area.x(1.0), y)])) {
                    title { (self.bound_name) }
                }
            }
            g class={ "s" (self.series) } {
                path class="actual" d=(path(line)) { title { (self.label) } }
            }
            @for prediction in predictions {
                @let (x, y) = px(prediction[0]);
                path class="predicted" d=(path(prediction.into_iter().map(px))) {}
                circle class="predicts" cx=(Px(x)) cy=(Px(y)) r="2.2" {}
            }
        }
    }

    /// What the plans in force at some instants predicted, each from that instant until two instants later.
    fn predictions(
        &self,
        rover: &RoverHistory,
        (from_ns, to_ns): (u64, u64),
    ) -> Vec<Vec<(u64, f64)>> {
        let apart_ns = (to_ns - from_ns) / PREDICTIONS;
        let of = |number: u64| {
            let at_ns = from_ns + number * apart_ns;
            let until_ns = (at_ns + 2 * apart_ns).min(to_ns);
            let (_, plan) = rover.plan_at(at_ns)?;
            let now = (at_ns, (self.level)(&rover.level_at(at_ns)?));
            let ahead = plan.activities.iter();
            let ahead = ahead.map(|one| (one.ends.as_nanos(), (self.predicted)(one)));
            let ahead = ahead.filter(|(ends_ns, _)| (at_ns + 1..=until_ns).contains(ends_ns));
            let points: Vec<(u64, f64)> = [now].into_iter().chain(ahead).collect();
            (points.len() > 1).then_some(points)
        };
        (0..PREDICTIONS).filter_map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::messages::{Activity, PlanMade, PlanMode, ReplanCause};
    use crate::survey::picture::history::Level;
    use farside::SimTime;

    const S_NS: u64 = 1_000_000_000;

    /// A plan that predicts so much at the end of each hour.
    fn plan(battery_j: f64) -> PlanMade {
        let hour = |number: u64| PlannedActivity {
            activity: Activity::Communication(0),
            position_m: [0.0; 2],
            starts: SimTime::from_secs(3600 * number),
            ends: SimTime::from_secs(3600 * (number + 1)),
            battery_j,
            memory_bits: 0,
        };
        PlanMade {
            number: 1,
            cause: ReplanCause::Started,
            mode: PlanMode::Continuous,
            edition: 1,
            operations: 0,
            moved: 0,
            shed: Vec::new(),
            unmet: Vec::new(),
            score: 0.0,
            traverse_m: 0.0,
            reserve_j: 0.0,
            memory_size_bits: 0,
            activities: (0..24).map(hour).collect(),
        }
    }

    #[test]
    fn what_is_predicted_is_what_the_plan_of_that_time_says() {
        let end_ns = 24 * 3600 * S_NS;
        let rover = RoverHistory {
            plans: vec![(0, plan(36e3)), (end_ns / 2, plan(72e3))],
            levels: vec![Level {
                time_ns: 0,
                battery_j: 180e3,
                memory_bits: 0.0,
            }],
            ..RoverHistory::default()
        };
        let predictions = BATTERY.predictions(&rover, (0, end_ns));
        assert_eq!(predictions.len() as u64, PREDICTIONS);
        for prediction in predictions {
            let (at_ns, now_wh) = prediction[0];
            let expected_wh = if at_ns < end_ns / 2 { 10.0 } else { 20.0 };
            assert_eq!(now_wh, 50.0);
            assert!(prediction[1..].iter().all(|(_, wh)| *wh == expected_wh));
        }
    }
}
