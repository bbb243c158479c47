//! A plan as a Gantt chart: an SVG file of its own.
//!
//! Each timeline has a lane; tokens that a free timeline has at once are put into rows. A bar is a
//! token at its fixed times, a thin line below it the times to which it can move, a diamond says
//! that it achieves a goal. Below are the levels of resources, with their limits, and what the
//! marks mean. Predicates differ in colour (those of Okabe and Ito, *Color Universal Design*, 2008)
//! and in hatching, so that the chart is read without colours as well.
//!
//! ```
//! use farside_planning::draw;
//! use farside_planning::plan::Plan;
//! let plan = Plan { problem: "day 1".into(), horizon: 100, ..Plan::default() };
//! let svg = draw::svg(&plan)?;
//! assert!(svg.starts_with("<svg ") && svg.contains("day 1"));
//! # Ok::<(), draw::DrawError>(())
//! ```

mod lanes;
mod levels;
mod marks;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use crate::Ticks;
use crate::plan::{Plan, PlanToken, TokenId};
use lanes::Lane;
use marks::{Sheet, shortened, text_width};

/// The most tokens that are drawn.
pub const MAX_TOKENS: usize = 20_000;

/// Why a plan is not drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// Nobody could read it.
    #[error("the plan has {actual} tokens; at most {MAX_TOKENS} are drawn")]
    TooMany {
        /// How many there are.
        actual: usize,
    },
}

/// The width of a chart, in pixels of its own.
const WIDTH: f64 = 960.0;
/// The room to the right of the plot: half the width of the last tick's text.
const RIGHT: f64 = 28.0;
/// The room above the plot.
const TOP: f64 = 64.0;
/// The height of a row of tokens, and of the bars in it.
const ROW: f64 = 30.0;
const BAR: f64 = 20.0;
/// The room between lanes.
const BETWEEN: f64 = 6.0;
/// The height of a resource's levels, and the room above for its name.
const LEVELS: f64 = 62.0;
const ABOVE_LEVELS: f64 = 32.0;
/// The height of a line of text.
const LINE: f64 = 19.0;

/// What is written, the colour of what is said beside, and of grid lines.
const INK: &str = "#1b1f24";
const SOFT: &str = "#59626d";
const RULE: &str = "#dfe3e8";
/// What is wrong.
const BAD: &str = "#b3261e";

/// The chart of a plan.
///
/// # Errors
///
/// If the plan has more than [`MAX_TOKENS`] tokens.
pub fn svg(plan: &Plan) -> Result<String, DrawError> {
    if plan.tokens.len() > MAX_TOKENS {
        return Err(DrawError::TooMany {
            actual: plan.tokens.len(),
        });
    }
    Ok(Chart::new(plan).draw())
}

/// Where things go.
struct Chart<'a> {
    plan: &'a Plan,
    /// The goals that a token achieves.
    goals: BTreeMap<TokenId, Vec<&'a str>>,
    /// The predicates, in the order in which they first appear: the colours.
    predicates: Vec<&'a str>,
    lanes: Vec<Lane<'a>>,
    /// The times that the axis shows.
    until: Ticks,
    /// The x of time 0.
    left: f64,
}

impl<'a> Chart<'a> {
    fn new(plan: &'a Plan) -> Self {
        let mut goals: BTreeMap<TokenId, Vec<&str>> = BTreeMap::new();
        for one in &plan.achieved {
            goals.entry(one.token).or_default().push(&one.goal);
        }
        let mut predicates: Vec<&str> = Vec::new();
        for token in &plan.tokens {
            if !predicates.contains(&token.predicate.as_str()) {
                predicates.push(&token.predicate);
            }
        }
        let names = plan.timelines.iter().map(|timeline| &timeline.name);
        let names = names.chain(plan.tokens.iter().map(|token| &token.timeline));
        let names = names.chain(plan.resources.iter().map(|resource| &resource.name));
        let widest = names
            .map(|name| text_width(&shortened(name, 30)))
            .fold(60.0, f64::max);
        let mut chart = Chart {
            plan,
            goals,
            predicates,
            lanes: Vec::new(),
            until: until(plan),
            left: widest + 22.0,
        };
        chart.lanes = lanes::of(&chart);
        chart
    }

    /// The x of a time.
    fn x(&self, time: Ticks) -> f64 {
        let time = time.clamp(0, self.until) as f64;
        self.left + time / self.until as f64 * (WIDTH - RIGHT - self.left)
    }

    fn draw(&self) -> String {
        let rows = self
            .lanes
            .iter()
            .map(|lane| lane.rows.len() as f64 * ROW + BETWEEN);
        let of_lanes: f64 = rows.sum();
        let of_levels = self.plan.resources.len() as f64 * (ABOVE_LEVELS + LEVELS);
        let bottom = TOP + of_lanes + of_levels;
        let mut sheet = Sheet::default();
        self.title(&mut sheet);
        self.grid(&mut sheet, bottom);
        let mut y = TOP;
        for lane in &self.lanes {
            lane.draw(self, &mut sheet, y);
            y += lane.rows.len() as f64 * ROW + BETWEEN;
        }
        for resource in &self.plan.resources {
            levels::draw(self, &mut sheet, resource, y + ABOVE_LEVELS);
            y += ABOVE_LEVELS + LEVELS;
        }
        let y = self.legend(&mut sheet, bottom + 58.0);
        let description = format!(
            "{} tokens on {} timelines, {} goals achieved and {} left out.",
            self.plan.tokens.len(),
            self.lanes.len(),
            self.plan.achieved.len(),
            self.plan.left_out.len()
        );
        let title = format!("Plan for {}", self.plan.problem);
        sheet.finish([WIDTH, y], &title, &description, self.predicates.len())
    }

    fn title(&self, sheet: &mut Sheet) {
        let Plan {
            problem,
            model,
            planner,
            makespan,
            score,
            ..
        } = self.plan;
        sheet.text([8.0, 24.0], "title", &shortened(problem, 60));
        let by = match planner.as_str() {
            "" => String::new(),
            name => format!(", planned by {}", shortened(name, 20)),
        };
        let model = shortened(model, 40);
        let facts = format!("model {model}{by}; makespan {makespan}, score {score}");
        sheet.text([8.0, 44.0], "soft", &facts);
    }

    /// Lines at round times, and what they are.
    fn grid(&self, sheet: &mut Sheet, bottom: f64) {
        let room = (WIDTH - RIGHT - self.left) / (text_width(&self.until.to_string()) + 14.0);
        let step = step(self.until, (room as Ticks).clamp(1, 10));
        let mut next = Some(0_i64);
        while let Some(time) = next.filter(|&time| time <= self.until) {
            let x = self.x(time);
            sheet.line([x, TOP - 4.0], [x, bottom], "grid");
            sheet.text([x, bottom + 17.0], "tick middle", &time.to_string());
            next = time.checked_add(step);
        }
        sheet.line([self.left, bottom], [WIDTH - RIGHT, bottom], "axis");
        let label = match self.until < self.plan.horizon {
            true => format!("time [ticks] (the horizon ends at {})", self.plan.horizon),
            false => "time [ticks]".to_owned(),
        };
        let middle = (self.left + WIDTH - RIGHT) / 2.0;
        sheet.text([middle, bottom + 36.0], "bold middle", &label);
    }

    /// What marks mean, and which goals are left out; the y below.
    fn legend(&self, sheet: &mut Sheet, top: f64) -> f64 {
        let (mut x, mut y) = (8.0, top);
        let mut place = |width: f64| {
            if x + width > WIDTH - 8.0 && x > 8.0 {
                (x, y) = (8.0, y + LINE + 3.0);
            }
            let at = [x, y];
            x += width;
            at
        };
        for (index, name) in self.predicates.iter().enumerate() {
            let name = shortened(name, 40);
            let [x, y] = place(30.0 + text_width(&name) + 18.0);
            sheet.bar([x, y - 11.0, 24.0, 14.0], index, false, &name);
            sheet.text([x + 30.0, y], "", &name);
        }
        if !self.goals.is_empty() {
            let text = "achieves a goal";
            let [x, y] = place(18.0 + text_width(text) + 18.0);
            sheet.diamond([x + 6.0, y - 4.5]);
            sheet.text([x + 18.0, y], "", text);
        }
        if self.plan.tokens.iter().any(is_flexible) {
            let text = "how far it can move";
            let [x, y] = place(32.0 + text_width(text) + 18.0);
            sheet.extent([x, x + 26.0], y - 4.0, text);
            sheet.text([x + 32.0, y], "", text);
        }
        y += 12.0;
        for one in self.plan.left_out.iter().take(20) {
            y += LINE;
            let text = match one.reason.as_str() {
                "" => format!("left out: {}", one.goal),
                reason => format!("left out: {} ({reason})", one.goal),
            };
            sheet.text([8.0, y], "soft", &shortened(&text, 130));
        }
        if let Some(more) = self
            .plan
            .left_out
            .len()
            .checked_sub(20)
            .filter(|&more| more > 0)
        {
            y += LINE;
            sheet.text(
                [8.0, y],
                "soft",
                &format!("and {more} more goals are left out"),
            );
        }
        y + 10.0
    }
}

/// Whether a token can move.
fn is_flexible(token: &PlanToken) -> bool {
    let ([a, b], [c, d]) = (token.start_window, token.end_window);
    a < token.start || token.start < b || c < token.end || token.end < d
}

/// The end of the axis: the horizon, unless what happens is over long before.
fn until(plan: &Plan) -> Ticks {
    let horizon = plan.horizon.max(1);
    let ends = plan
        .tokens
        .iter()
        .map(|token| token.end.max(token.end_window[1]));
    let changes = plan.resources.iter().flat_map(|resource| &resource.changes);
    let changes = changes.map(|&(at, _)| at).filter(|&at| at <= horizon);
    let last = ends
        .chain(changes)
        .max()
        .unwrap_or(horizon)
        .clamp(1, horizon);
    match last < horizon / 4 * 3 {
        // A tenth more, so that it is seen that nothing follows.
        true => last + last / 10 + 1,
        false => horizon,
    }
}

/// A round step of which there are at most so many up to a time.
fn step(until: Ticks, most: Ticks) -> Ticks {
    let mut power = 1;
    loop {
        for factor in [1, 2, 5] {
            if until / (power * factor) <= most {
                return power * factor;
            }
        }
        power *= 10;
    }
}
