//! Whether what a rule says of numbers and times can hold at all.
//!
//! Bounds, comparisons and equalities are differences of two numbers, each at most so much; they
//! contradict each other if and only if some of them make a cycle whose sum is negative (R.
//! Dechter, I. Meiri, J. Pearl, *Temporal Constraint Networks*, 1991).

use crate::language::analyse::rule::Draft;
use crate::language::findings::{Notes, Severity};
use crate::model::{
    Bound, Distance, End, Model, Operand, Position, Relation, Relationship, RelationshipKind,
    Target, Value, Values,
};

/// The most steps that a check of a rule takes; larger rules are left to the planner.
const MOST_STEPS: usize = 2_000_000;

/// That `to - from` is at most `most`.
#[derive(Clone, Copy, Debug)]
struct Difference {
    from: usize,
    to: usize,
    most: i128,
    position: Position,
}

struct Rows<'m, 'd, 't> {
    model: &'m Model,
    draft: &'d Draft<'t>,
    list: Vec<Difference>,
}

/// Notes constants that break a constraint, and cycles of bounds that cannot all hold.
pub(super) fn check(model: &Model, draft: &Draft, notes: &mut Notes) {
    let constraints = draft
        .rule
        .relationships
        .iter()
        .map(|of| (of, Severity::Error));
    let guards = draft.rule.when.iter().map(|of| (of, Severity::Warning));
    for (relationship, severity) in constraints.chain(guards) {
        if holds(model, relationship) == Some(false) {
            let expected = "a constraint of constants that holds";
            notes.note(
                severity,
                relationship.position,
                expected,
                "one that does not",
            );
        }
    }
    let mut rows = Rows {
        model,
        draft,
        list: Vec::new(),
    };
    rows.of_rule();
    let count = rows.points();
    if count.saturating_mul(rows.list.len()) > MOST_STEPS {
        return;
    }
    if let Some(cycle) = negative_cycle(count, &rows.list) {
        let shown: Vec<String> = cycle.iter().map(|row| rows.show(row)).collect();
        let expected = "bounds and constraints that can all hold";
        let found = format!("these that cannot: {}", shown.join(", "));
        notes.note(Severity::Error, cycle[0].position, expected, found);
    }
}

/// Whether a constraint of constants holds; none if it is one of variables.
pub(super) fn holds(model: &Model, relationship: &Relationship) -> Option<bool> {
    let value = |operand: &Operand| match operand {
        Operand::Value(value) => Some(*value),
        _ => None,
    };
    let values: Option<Vec<Value>> = relationship.operands.iter().map(value).collect();
    decide(model, relationship.kind, &values?)
}

/// Whether a constraint holds of some values; none if a function does not know.
pub(super) fn decide(model: &Model, kind: RelationshipKind, values: &[Value]) -> Option<bool> {
    let (last, inputs) = values.split_last()?;
    let wide = |values: &[Value]| -> Vec<i128> { values.iter().map(|v| i128::from(*v)).collect() };
    Some(match kind {
        RelationshipKind::Equal => inputs.iter().all(|value| value == last),
        RelationshipKind::Different => inputs[0] != *last,
        RelationshipKind::Less => inputs[0] < *last,
        RelationshipKind::AtMost => inputs[0] <= *last,
        RelationshipKind::Sum => wide(inputs).iter().sum::<i128>() == i128::from(*last),
        RelationshipKind::Product => {
            let product = wide(inputs)
                .iter()
                .try_fold(1_i128, |all, one| all.checked_mul(*one));
            product? == i128::from(*last)
        }
        RelationshipKind::Table(table) => {
            let table = &model.tables[table];
            table
                .rows
                .chunks(table.columns.max(1))
                .any(|row| row == values)
        }
        RelationshipKind::Function(at) => (model.functions[at].call)(inputs)? == *last,
    })
}

/// The point that is always 0.
const ZERO: usize = 0;

impl Rows<'_, '_, '_> {
    /// How many points there are: zero, the variables, and two for each token.
    fn points(&self) -> usize {
        1 + self.draft.rule.variables.len() + 2 * self.draft.rule.labels
    }

    fn time(&self, end: End, label: usize) -> usize {
        1 + self.draft.rule.variables.len() + 2 * label + usize::from(end == End::Finish)
    }

    /// That `to - from` is at most `most`.
    fn at_most(&mut self, from: usize, to: usize, most: Value, position: Position) {
        self.list.push(Difference {
            from,
            to,
            most: i128::from(most),
            position,
        });
    }

    /// That `to - from` is at least `least`.
    fn at_least(&mut self, from: usize, to: usize, least: Value, position: Position) {
        self.list.push(Difference {
            from: to,
            to: from,
            most: -i128::from(least),
            position,
        });
    }

    fn of_rule(&mut self) {
        let (model, draft) = (self.model, self.draft);
        let rule = &draft.rule;
        for (id, variable) in rule.variables.iter().enumerate() {
            if let Values::Numbers(span) = &model.types[variable.of].values {
                let ends = [(span.max, true), (span.min, false)];
                for (value, upper) in ends {
                    match value {
                        Value::MIN | Value::MAX => {}
                        _ if upper => self.at_most(ZERO, id + 1, value, rule.position),
                        _ => self.at_least(ZERO, id + 1, value, rule.position),
                    }
                }
            }
        }
        for label in 0..rule.labels {
            let [start, finish] = [End::Start, End::Finish].map(|end| self.time(end, label));
            self.at_least(start, finish, 0, rule.position);
        }
        if let Some([min, max]) = rule.duration {
            let [from, to] = [self.time(End::Start, 0), self.time(End::Finish, 0)];
            self.bounds(from, to, min, max, rule.position);
        }
        let mut relations = Vec::new();
        super::certain(&rule.body, &mut relations);
        for relation in relations {
            self.relation(relation);
        }
        for relationship in &rule.relationships {
            self.relationship(relationship);
        }
    }

    fn bounds(&mut self, from: usize, to: usize, min: Bound, max: Bound, position: Position) {
        if let Bound::Value(min) = min {
            self.at_least(from, to, min, position);
        }
        if let Bound::Value(max) = max {
            self.at_most(from, to, max, position);
        }
    }

    fn relation(&mut self, relation: &Relation) {
        let target = match &relation.target {
            Target::New(_, label) | Target::Label(label) => *label,
        };
        for &Distance {
            from,
            to,
            min,
            max,
            backward,
        } in &relation.distances
        {
            let (anchor, target) = (self.time(from, relation.anchor), self.time(to, target));
            let (first, last) = if backward {
                (target, anchor)
            } else {
                (anchor, target)
            };
            self.bounds(first, last, min, max, relation.position);
        }
    }

    /// An operand as a point and what is added to it; none if it is a duration.
    fn point(&self, operand: Operand) -> Option<(usize, Value)> {
        match operand {
            Operand::Value(value) => Some((ZERO, value)),
            Operand::Variable(id) => Some((id + 1, 0)),
            Operand::Start(label) => Some((self.time(End::Start, label), 0)),
            Operand::Finish(label) => Some((self.time(End::Finish, label), 0)),
            Operand::Duration(_) => None,
        }
    }

    fn relationship(&mut self, relationship: &Relationship) {
        let gap = match relationship.kind {
            RelationshipKind::Less => 1,
            RelationshipKind::AtMost | RelationshipKind::Equal => 0,
            _ => return,
        };
        for pair in relationship.operands.windows(2) {
            self.not_above(pair[0], pair[1], gap, relationship.position);
            if relationship.kind == RelationshipKind::Equal {
                self.not_above(pair[1], pair[0], gap, relationship.position);
            }
        }
    }

    /// That `low + gap <= high`.
    fn not_above(&mut self, low: Operand, high: Operand, gap: Value, position: Position) {
        match (low, high) {
            (Operand::Duration(label), Operand::Value(value)) => {
                let [start, finish] = [End::Start, End::Finish].map(|end| self.time(end, label));
                self.at_most(start, finish, value.saturating_sub(gap), position);
            }
            (Operand::Value(value), Operand::Duration(label)) => {
                let [start, finish] = [End::Start, End::Finish].map(|end| self.time(end, label));
                self.at_least(start, finish, value.saturating_add(gap), position);
            }
            _ => {
                let (Some((low, a)), Some((high, b))) = (self.point(low), self.point(high)) else {
                    return;
                };
                if low != high || low != ZERO {
                    let least = gap.saturating_add(a).saturating_sub(b);
                    self.at_least(low, high, least, position);
                }
            }
        }
    }

    fn name(&self, point: usize) -> String {
        let variables = &self.draft.rule.variables;
        match point.checked_sub(1) {
            None => "0".to_owned(),
            Some(id) if id < variables.len() => variables[id].name.clone(),
            Some(id) => {
                let (label, end) = ((id - variables.len()) / 2, (id - variables.len()) % 2);
                let named = self.draft.labels.iter().find(|(_, of)| **of == label);
                let token = named.map_or(format!("token {label}"), |(name, _)| (*name).to_owned());
                format!("{} of {token}", if end == 0 { "start" } else { "end" })
            }
        }
    }

    fn show(&self, row: &Difference) -> String {
        let (from, to) = (self.name(row.from), self.name(row.to));
        let position = row.position;
        match row.most {
            most if row.from == ZERO => format!("{to} <= {most} ({position})"),
            most if row.to == ZERO => format!("{} <= {from} ({position})", -most),
            0 => format!("{to} <= {from} ({position})"),
            most if most < 0 => format!("{to} + {} <= {from} ({position})", -most),
            most => format!("{to} <= {from} + {most} ({position})"),
        }
    }
}

/// A cycle of differences whose sum is negative, in the order of the cycle.
fn negative_cycle(points: usize, rows: &[Difference]) -> Option<Vec<Difference>> {
    let mut distance = vec![0_i128; points];
    let mut by: Vec<Option<usize>> = vec![None; points];
    let mut changed = None;
    for _ in 0..points {
        changed = None;
        for (place, row) in rows.iter().enumerate() {
            let there = distance[row.from] + row.most;
            if there < distance[row.to] {
                distance[row.to] = there;
                by[row.to] = Some(place);
                changed = Some(row.to);
            }
        }
        changed?;
    }
    // After as many rounds as points, a change rests on a cycle: going back that often enters it.
    let mut at = changed?;
    for _ in 0..points {
        at = rows[by[at]?].from;
    }
    let (start, mut cycle) = (at, Vec::new());
    loop {
        let row = rows[by[at]?];
        cycle.push(row);
        at = row.from;
        if at == start {
            break;
        }
    }
    cycle.reverse();
    // It starts with what stands first in the text.
    let first = (0..cycle.len()).min_by_key(|&place| cycle[place].position)?;
    cycle.rotate_left(first);
    Some(cycle)
}
