//! The flexible times of a plan, and the constraints that it lists.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use super::{Kind, Report, Scene};
use crate::Ticks;
use crate::plan::{Moment, PlanConstraint, PlanEnd, TokenId};

pub(super) fn check(scene: &Scene<'_>, report: &mut Report) {
    let fixed = contain_times(scene, report);
    if scene.plan.constraints.is_empty() || !fixed {
        return;
    }
    let Some(points) = Points::new(scene, report) else {
        return;
    };
    let (earliest, latest) = points.windows(scene.problem.horizon);
    for (index, seen) in scene.tokens.iter().enumerate() {
        let token = seen.token;
        let windows = [
            ("start_window", token.start_window, 2 * index + 1),
            ("end_window", token.end_window, 2 * index + 2),
        ];
        for (name, is, point) in windows {
            let should = [earliest[point], latest[point]];
            if is != should {
                let message = format!(
                    "the {name} of token {token} is {is:?}, and the plan's constraints make it \
                     {should:?}"
                );
                let added = report.add(Kind::Window, message).tokens([token.id]);
                added.times(is[0], is[1]);
            }
        }
    }
}

/// That each window holds the fixed time, and lies in the horizon. Whether the fixed times do.
fn contain_times(scene: &Scene<'_>, report: &mut Report) -> bool {
    let horizon = scene.problem.horizon;
    let mut all = true;
    for seen in &scene.tokens {
        let token = seen.token;
        all &= token.start >= 0 && token.end <= horizon;
        let windows = [
            ("start", token.start, token.start_window),
            ("end", token.end, token.end_window),
        ];
        for (name, time, [from, to]) in windows {
            let is_in = from <= time && time <= to;
            if is_in && 0 <= from && to <= horizon {
                continue;
            }
            let message = match is_in {
                true => format!("the {name}_window of token {token} is not in the horizon"),
                false => format!("the {name} of token {token} is not in its {name}_window"),
            };
            let added = report.add(Kind::Window, format!("{message}: [{from} {to}]"));
            added.tokens([token.id]).times(from, to);
        }
    }
    all
}

/// The constraints as inequalities between points, all of which the fixed times satisfy. Point 0 is
/// time 0; 2i + 1 and 2i + 2 are start and end of token i.
struct Points {
    times: Vec<Ticks>,
    /// By point: the points that lie at least so many ticks later.
    later: Vec<Vec<(usize, Ticks)>>,
    /// By point: the points that lie at least so many ticks earlier.
    earlier: Vec<Vec<(usize, Ticks)>>,
}

impl Points {
    /// None if the fixed times violate a constraint, which is reported.
    fn new(scene: &Scene<'_>, report: &mut Report) -> Option<Points> {
        let index_of: BTreeMap<TokenId, usize> = scene
            .tokens
            .iter()
            .enumerate()
            .map(|(index, seen)| (seen.token.id, index))
            .collect();
        let ends = |index: usize| {
            [
                scene.tokens[index].token.start,
                scene.tokens[index].token.end,
            ]
        };
        let times = [0]
            .into_iter()
            .chain((0..scene.tokens.len()).flat_map(ends));
        let times: Vec<Ticks> = times.collect();
        let mut points = Points {
            later: vec![Vec::new(); times.len()],
            earlier: vec![Vec::new(); times.len()],
            times,
        };
        for index in 0..scene.tokens.len() {
            points.add(2 * index + 1, 2 * index + 2, 0);
        }
        let point = |moment: Option<Moment>| match moment {
            None => Some(0),
            Some(Moment { token, at }) => {
                let first = 2 * index_of.get(&token)?;
                Some(first + if at == PlanEnd::Start { 1 } else { 2 })
            }
        };
        let mut satisfied = true;
        for constraint in &scene.plan.constraints {
            let (Some(from), Some(to)) = (point(constraint.from), point(constraint.to)) else {
                let why = &constraint.why;
                let message = format!("a constraint ({why}) is about a token that is none");
                report.add(Kind::Constraint, message);
                return None;
            };
            let apart = points.times[to] - points.times[from];
            let is_kept = constraint.min.is_none_or(|min| min <= apart)
                && constraint.max.is_none_or(|max| apart <= max);
            if !is_kept {
                satisfied = false;
                violated(constraint, apart, report);
            }
            if let Some(min) = constraint.min {
                points.add(from, to, min);
            }
            if let Some(max) = constraint.max {
                points.add(to, from, max.saturating_neg());
            }
        }
        satisfied.then_some(points)
    }

    /// That `to` lies at least `gap` after `from`.
    fn add(&mut self, from: usize, to: usize, gap: Ticks) {
        self.later[from].push((to, gap));
        self.earlier[to].push((from, gap));
    }

    /// The earliest and the latest time of each point.
    ///
    /// A point can come earlier by as much as what it must follow can, and by the slack between
    /// them: the least of such sums, by Dijkstra's algorithm. The fixed times make slacks positive.
    fn windows(&self, horizon: Ticks) -> (Vec<Ticks>, Vec<Ticks>) {
        let slack =
            |from: Ticks, to: Ticks, gap: Ticks| to.saturating_sub(from).saturating_sub(gap);
        let early = self.least_moves(&self.later, slack, |time| time);
        let late = self.least_moves(
            &self.earlier,
            |from, to, gap| slack(to, from, gap),
            |time| horizon - time,
        );
        let times = self.times.iter();
        let earliest = times.clone().zip(&early).map(|(time, by)| time - by);
        let latest = times.zip(&late).map(|(time, by)| time + by);
        (earliest.collect(), latest.collect())
    }

    /// By how much each point can move. `slack` is of two points' times and their gap, `room` how
    /// far it is from a time to where the horizon ends.
    fn least_moves(
        &self,
        edges: &[Vec<(usize, Ticks)>],
        slack: impl Fn(Ticks, Ticks, Ticks) -> Ticks,
        room: impl Fn(Ticks) -> Ticks,
    ) -> Vec<Ticks> {
        let mut moves: Vec<Ticks> = self.times.iter().map(|&time| room(time)).collect();
        moves[0] = 0;
        let queued = moves
            .iter()
            .enumerate()
            .map(|(point, &by)| Reverse((by, point)));
        let mut queue: BinaryHeap<_> = queued.collect();
        while let Some(Reverse((by, from))) = queue.pop() {
            if by > moves[from] {
                continue;
            }
            for &(to, gap) in &edges[from] {
                let with = by.saturating_add(slack(self.times[from], self.times[to], gap));
                if with < moves[to] {
                    moves[to] = with;
                    queue.push(Reverse((with, to)));
                }
            }
        }
        moves
    }
}

/// Reports a constraint that the fixed times violate.
fn violated(constraint: &PlanConstraint, apart: Ticks, report: &mut Report) {
    let named = |moment: Option<Moment>| match moment {
        None => "time 0".to_owned(),
        Some(Moment { token, at }) => match at {
            PlanEnd::Start => format!("the start of token {token}"),
            PlanEnd::End => format!("the end of token {token}"),
        },
    };
    let (from, to) = (named(constraint.from), named(constraint.to));
    let message =
        format!("from {from} to {to} it is {apart} ticks, which a constraint of the plan forbids");
    let moments = [constraint.from, constraint.to].into_iter().flatten();
    let added = report.add(Kind::Constraint, message);
    added
        .tokens(moments.map(|moment| moment.token))
        .at(constraint.why.clone());
}
