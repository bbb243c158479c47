//! What tells states apart: all that is known between two cycles, but for numbers and times that
//! make no difference to what is decided.

use farside_planning::Ticks;
use farside_planning::model::End;

use super::NotCompiled;
use super::classes::{Classes, Sorts};
use crate::service::propositional::rules::{Part, constant};
use crate::service::propositional::state::{Cell, Guard, Open, span};
use crate::service::propositional::{Propositional, Tables};
use crate::service::words;

/// The most ticks that are counted exactly: the longest distance that a relation asks for. What lies
/// further ahead is far.
pub(super) fn exact_ticks(tables: &Tables) -> Ticks {
    // What lasts two ticks at most, as polls do, need not be watched.
    let mut most = 2;
    for flat in &tables.flats {
        for distance in flat.relations.iter().flat_map(|at| &at.distances) {
            for bound in [distance.min, distance.max] {
                if let Some(bound) = constant(bound, 0) {
                    most = most.max(bound.saturating_abs());
                }
            }
        }
    }
    most
}

/// Whether all conditions of a model are of tokens that last now or ended now.
///
/// # Errors
///
/// If one may be of a token that ended before.
pub(super) fn check_present(tables: &Tables) -> Result<(), NotCompiled> {
    for (rule, flat) in tables.flats.iter().enumerate() {
        let said = &tables.model.rules[rule];
        let inputs = tables.model.predicates[said.master.predicate].inputs;
        // Whether its guard is decided when its master starts.
        let at_once = said
            .master
            .arguments
            .iter()
            .enumerate()
            .all(|(place, argument)| {
                place < inputs
                    || match argument {
                        farside_planning::model::Argument::Value(_) => false,
                        _ => said.when.is_empty(),
                    }
            });
        for relation in flat.relations.iter().filter(|at| at.condition) {
            let at_once = at_once && relation.anchor == 0;
            let may_be_past = relation.distances.iter().all(|distance| {
                let (min, _) = span(distance);
                match (distance.from, distance.to) {
                    (End::Finish, End::Finish) => min <= -1,
                    (End::Finish, End::Start) => min <= -2,
                    (End::Start, End::Finish) => !at_once || min <= -1,
                    (End::Start, End::Start) => !at_once || min <= -2,
                }
            });
            if may_be_past {
                return Err(NotCompiled::Past {
                    rule: words::rule(&tables.model, rule),
                    place: tables.model.place(relation.position),
                });
            }
        }
    }
    Ok(())
}

/// Whether an end lies further ahead than what is counted exactly.
pub(super) fn is_far(time: Ticks, tick: Ticks, exact: Ticks) -> bool {
    time != Ticks::MAX && time > tick + exact
}

/// How long a timeline's present token lasts at most by its own rules, if they say so.
pub(super) fn longest(is: &Propositional, timeline: usize) -> Option<Ticks> {
    let token = is.world.state.last(timeline)?;
    let instances = is.world.state.at(token).instances.iter();
    let holds = instances.filter(|at| at.guard == Guard::Holds);
    let bounds = holds.filter_map(|at| is.tables.flats[at.rule].duration);
    bounds.map(|[_, most]| most).min()
}

/// What is known, in numbers, but for what makes no difference; none, if a rule holds a
/// number that is not sorted.
pub(super) fn key(is: &Propositional, sorts: &Sorts, exact: Ticks) -> Option<Vec<u32>> {
    let (state, tick) = (&is.world.state, is.now);
    let mut key: Vec<u32> = Vec::with_capacity(256);
    for (timeline, lane) in state.lanes.iter().enumerate() {
        let token = *lane.tokens.last()?;
        let at = state.at(token);
        let (_, max) = state.finish(token);
        // Whether its end is a time-out tells how it ends.
        let longest = longest(is, timeline);
        let near = max != Ticks::MAX && !is_far(max, tick, exact);
        let own = near && longest.is_some_and(|longest| at.start.saturating_add(longest) == max);
        key.extend([
            at.predicate as u32,
            u32::from(at.fills) | u32::from(is.ends[timeline]) << 1 | u32::from(own) << 2,
            u32::from(at.finish),
        ]);
        let class = |cell: Cell, classes: &Classes| {
            let known = &state.cells[usize::from(cell)];
            known.value.map_or(0, |value| 1 + classes.of(value))
        };
        for (&cell, classes) in at.parameters.iter().zip(&sorts.parameters[at.predicate]) {
            key.extend([u32::from(cell), class(cell, classes)]);
        }
        for said in &at.instances {
            key.extend([u32::MAX, said.rule as u32, said.guard as u32]);
            for (&cell, classes) in said.variables.iter().zip(&sorts.variables[said.rule]) {
                let is_known = |cell: Cell| state.cells[usize::from(cell)].value.is_some();
                if matches!(classes, Classes::Unsorted) && cell.is_some_and(is_known) {
                    return None;
                }
                key.push(cell.map_or(u32::MAX, u32::from));
                key.extend(cell.map(|cell| class(cell, classes)));
            }
            key.push(u32::MAX);
            key.extend(said.labels.iter().map(|at| at.map_or(u32::MAX, u32::from)));
        }
        key.push(u32::MAX - 1);
    }
    for known in &state.cells {
        // Numbers are told apart where they are parameters or variables.
        let class = match known.value {
            None => 0,
            Some(_) if is.tables.is_measured(known.of) => 1,
            Some(value) => 1 + value as u32,
        };
        key.extend([
            known.of as u32,
            known.also.map_or(u32::MAX, |of| of as u32),
            class,
        ]);
    }
    for bounds in &state.finishes {
        key.push(match bounds.min {
            min if is_far(min, tick, exact) => u32::MAX - 1 - u32::from(bounds.min == bounds.max),
            min => (min - tick).max(0) as u32,
        });
        key.push(match bounds.max {
            Ticks::MAX => u32::MAX,
            max if is_far(max, tick, exact) => u32::MAX - 1,
            max => u32::try_from(max - tick).ok()?,
        });
    }
    for gap in &state.gaps {
        key.extend([u32::from(gap.from), u32::from(gap.to), gap.rule as u32]);
        key.extend([gap.min as u32, gap.max as u32]);
    }
    key.push(u32::MAX);
    for &Open {
        token,
        instance,
        part,
    } in &state.open
    {
        let part = match part {
            Part::Relation(at) => u32::from(at) << 1,
            Part::Choice(at) => u32::from(at) << 1 | 1,
        };
        key.extend([u32::from(token), u32::from(instance), part]);
    }
    Some(key)
}
