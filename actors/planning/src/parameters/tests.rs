//! The store beside the same rules from scratch, and beside all assignments.

mod cases;
mod naive;

use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;
use crate::temporal::Span;
use naive::{Naive, Naives, Said, from_scratch, holds};

/// Numbers that make up a domain.
#[derive(Clone, Debug)]
enum Values {
    Span(i64, i64),
    Of(Vec<i64>),
}

/// What is asked of a store, each with numbers that pick among what there is.
#[derive(Clone, Debug)]
enum Edit {
    Add(Values),
    Remove(Vec<usize>),
    Restrict(usize, Values),
    Post(Says, Vec<Pick>),
    Retract(Vec<usize>),
    Push,
    Pop,
    Commit,
}

#[derive(Clone, Debug)]
enum Says {
    Equal,
    Different,
    Less,
    AtMost,
    Sum,
    Product,
    Table(Vec<i64>),
    Function,
}

#[derive(Clone, Debug)]
enum Pick {
    Value(i64),
    Variable(usize),
}

/// Nothing for a negative sum, and numbers from 0 to 4 for others.
fn call(inputs: &[Value]) -> Option<Value> {
    let sum = inputs
        .iter()
        .fold(0, |sum: Value, &x| sum.saturating_add(x));
    (sum >= 0).then_some(sum % 5)
}

fn values() -> impl Strategy<Value = Values> {
    let value = -9..10i64;
    prop_oneof![
        3 => (value.clone(), 0..12i64).prop_map(|(min, more)| Values::Span(min, min + more)),
        1 => value.clone().prop_map(|value| Values::Span(value, value)),
        2 => prop::collection::vec(value, 1..6).prop_map(Values::Of),
        1 => Just(Values::Span(2, 1)),
    ]
}

fn says() -> impl Strategy<Value = Says> {
    prop_oneof![
        4 => Just(Says::Equal),
        2 => Just(Says::Different),
        1 => Just(Says::Less),
        1 => Just(Says::AtMost),
        2 => Just(Says::Sum),
        2 => Just(Says::Product),
        2 => prop::collection::vec(-9..10i64, 3..30).prop_map(Says::Table),
        2 => Just(Says::Function),
    ]
}

fn edit() -> impl Strategy<Value = Edit> {
    let pick = || 0..1_000usize;
    let operand = prop_oneof![
        4 => pick().prop_map(Pick::Variable),
        1 => (-9..10i64).prop_map(Pick::Value),
    ];
    let operands = prop::collection::vec(operand, 2..5);
    prop_oneof![
        4 => values().prop_map(Edit::Add),
        1 => prop::collection::vec(pick(), 1..3).prop_map(Edit::Remove),
        6 => (pick(), values()).prop_map(|(at, values)| Edit::Restrict(at, values)),
        12 => (says(), operands).prop_map(|(says, operands)| Edit::Post(says, operands)),
        5 => prop::collection::vec(pick(), 1..3).prop_map(Edit::Retract),
        1 => Just(Edit::Push),
        1 => Just(Edit::Pop),
        1 => Just(Edit::Commit),
    ]
}

/// All that there is of a store, but for counts and for who changed.
#[derive(Clone, Debug, PartialEq)]
struct Whole {
    /// With what is known of it now, and without any constraint.
    variables: Vec<(Variable, Domain, Domain)>,
    /// The links of the variables in their order: constraint, and whether it narrowed it.
    links: Vec<(u32, u32, bool)>,
    constraints: Vec<(Constraint, u32, String)>,
    /// The ids that will be given.
    next: (Vec<Variable>, Vec<Constraint>),
    unfinished: bool,
}

fn whole(store: &Store<u32>) -> Whole {
    let (mut variables, mut links) = (Vec::new(), Vec::new());
    for (id, node) in store.nodes.iter() {
        let (mut next, mut before) = (node.first, NONE);
        while next != NONE {
            let link = store.links.all[next as usize];
            assert_eq!(link.before, before);
            links.push((next, link.constraint, link.narrowed));
            (next, before) = (link.next, next);
        }
        assert!(!node.marked);
        variables.push((id, node.domain.clone(), node.base.clone()));
    }
    let mut constraints = Vec::new();
    for (id, owner) in store.all_constraints() {
        let operands: Vec<Operand> = store.operands(id).collect();
        let edge = store.edge(id.index() as u32);
        assert!(!edge.queued && !edge.marked);
        constraints.push((id, *owner, format!("{:?} of {operands:?}", edge.kind)));
    }
    assert!(store.queue.is_empty());
    let mut more = store.clone();
    let next = (0..30).map(|_| {
        let variable = more.add(Domain::exactly(0));
        let constraint = more.restrict(variable, Domain::ALL, 0);
        (variable, constraint.unwrap())
    });
    Whole {
        variables,
        links,
        constraints,
        next: next.unzip(),
        unfinished: store.unfinished,
    }
}

/// A scale that takes domains to the ends of what there is, where rules can go on for ever.
const HUGE: i64 = i64::MAX / 21;

/// By owner.
type AllSaid = BTreeMap<u32, (Constraint, Said)>;

/// A store, and what it was asked for.
struct Both {
    store: Store<u32>,
    bases: Naives,
    said: AllSaid,
    marks: Vec<(Whole, Naives, AllSaid)>,
    scale: i64,
    /// How many variables there may be.
    most: usize,
}

impl Both {
    fn domain(&self, values: &Values) -> Domain {
        match values {
            Values::Span(min, max) => Span::new(min * self.scale, max * self.scale).into(),
            Values::Of(values) => Domain::of(values.iter().map(|value| value * self.scale)),
        }
    }

    fn variable(&self, pick: usize) -> Option<Variable> {
        let count = self.bases.len().max(1);
        self.bases.keys().nth(pick % count).copied()
    }

    fn said(&self, says: &Says, picks: &[Pick]) -> Option<Said> {
        let operand = |pick: &Pick| match pick {
            Pick::Value(value) => Some(Operand::Value(value * self.scale)),
            Pick::Variable(pick) => self.variable(*pick).map(Operand::Variable),
        };
        let mut operands: Vec<Operand> = picks.iter().map(operand).collect::<Option<_>>()?;
        let kind = match says {
            Says::Equal => Kind::Equal,
            Says::Different => Kind::Different,
            Says::Less => Kind::Less,
            Says::AtMost => Kind::AtMost,
            Says::Sum => Kind::Sum,
            Says::Product => Kind::Product,
            Says::Table(values) => {
                let columns = operands.len().min(3);
                let values: Vec<i64> = values.iter().map(|value| value * self.scale).collect();
                let whole = values.len() / columns * columns;
                Kind::Table(Rows::new(columns, &values[..whole]))
            }
            Says::Function => Kind::Function(call),
        };
        // The quotients by what lies between three wide intervals are too many to try each.
        if matches!(kind, Kind::Product) && self.scale > 1 {
            operands.truncate(3);
        }
        if matches!(kind, Kind::Table(_)) {
            operands.truncate(3);
        }
        if !kind.takes(operands.len()) {
            operands.truncate(2);
        }
        Some((kind, operands))
    }

    fn domains(&self) -> Naives {
        let all = self.store.all_domains();
        all.map(|(id, domain)| (id, domain.into())).collect()
    }

    fn apply(&mut self, owner: u32, edit: Edit) -> Result<(), TestCaseError> {
        match edit {
            Edit::Add(values) => {
                let domain = self.domain(&values);
                if !domain.is_empty() && self.bases.len() < self.most {
                    let base = (&domain).into();
                    self.bases.insert(self.store.add(domain), base);
                }
            }
            Edit::Remove(picks) => {
                let mut gone: Vec<Variable> = picks
                    .iter()
                    .filter_map(|&pick| self.variable(pick))
                    .collect();
                gone.dedup();
                prop_assert!(self.store.remove_all(&gone) || self.scale == HUGE);
                self.bases.retain(|variable, _| !gone.contains(variable));
                let store = &self.store;
                self.said
                    .retain(|_, (constraint, _)| store.has_constraint(*constraint));
            }
            Edit::Restrict(pick, values) => {
                if let Some(variable) = self.variable(pick) {
                    let kind = Kind::In(self.domain(&values));
                    self.post((kind, vec![variable.into()]), owner)?;
                }
            }
            Edit::Post(says, picks) => {
                if let Some(said) = self.said(&says, &picks) {
                    self.post(said, owner)?;
                }
            }
            Edit::Retract(picks) => {
                let mut gone = Vec::new();
                for pick in picks {
                    let count = self.said.len().max(1);
                    if let Some(&owner) = self.said.keys().nth(pick % count) {
                        gone.extend(self.said.remove(&owner).map(|(constraint, _)| constraint));
                    }
                }
                prop_assert!(self.store.retract_all(gone) || self.scale == HUGE);
            }
            Edit::Push => {
                self.store.push();
                let state = whole(&self.store);
                self.marks
                    .push((state, self.bases.clone(), self.said.clone()));
            }
            Edit::Pop => {
                self.store.pop();
                if let Some((state, bases, said)) = self.marks.pop() {
                    prop_assert!(whole(&self.store) == state, "popped, it is as before");
                    (self.bases, self.said) = (bases, said);
                }
            }
            Edit::Commit => {
                self.store.commit();
                self.marks.pop();
            }
        }
        Ok(())
    }

    /// Adds a constraint; where it is refused, nothing may change, and the conflict must be one.
    fn post(&mut self, said: Said, owner: u32) -> Result<(), TestCaseError> {
        let before = whole(&self.store);
        let outcome = self.store.post(said.0.clone(), &said.1, owner);
        if self.scale != HUGE {
            let all = self.said.values().map(|(_, said)| said).chain([&said]);
            let fits = from_scratch(self.bases.clone(), all).is_some();
            prop_assert_eq!(outcome.is_ok(), fits, "{:?}", said);
        }
        match outcome {
            Ok(constraint) => drop(self.said.insert(owner, (constraint, said))),
            Err(refusal) => {
                prop_assert!(whole(&self.store) == before, "refused, it changes nothing");
                match refusal {
                    Refusal::Conflict(conflict) if self.scale == HUGE => {
                        prop_assert!(!conflict.minimal(2_000).parts.is_empty());
                    }
                    Refusal::Conflict(conflict) => self.check(&conflict, (owner, &said))?,
                    Refusal::OverBudget { .. } => prop_assert_eq!(self.scale, HUGE),
                }
            }
        }
        Ok(())
    }

    /// Whether a conflict is one, and whether no part can be left out of the least of it.
    fn check(&self, conflict: &Conflict<u32>, new: (u32, &Said)) -> Result<(), TestCaseError> {
        let said = |owner: &u32| match self.said.get(owner) {
            Some((_, said)) => said,
            None => new.1,
        };
        let fits =
            |owners: &[u32]| from_scratch(self.bases.clone(), owners.iter().map(said)).is_some();
        for part in &conflict.parts {
            let known = self.said.get(&part.owner).map(|known| known.0);
            prop_assert_eq!(part.constraint, known);
            prop_assert!(known.is_some() || part.owner == new.0);
            prop_assert_eq!(&part.operands, &said(&part.owner).1);
        }
        let owners: Vec<u32> = conflict.owners().copied().collect();
        prop_assert!(!fits(&owners), "{}", conflict);
        let least = conflict.minimal(u64::MAX);
        prop_assert!(least.is_minimal);
        let owners: Vec<u32> = least.owners().copied().collect();
        prop_assert!(!fits(&owners), "{}", least);
        for at in 0..owners.len() {
            let mut fewer = owners.clone();
            fewer.remove(at);
            prop_assert!(fits(&fewer), "{} without {}", least, owners[at]);
        }
        Ok(())
    }

    /// Every domain is what the rules give from scratch.
    fn compare(&self) -> Result<(), TestCaseError> {
        if self.scale == HUGE {
            return Ok(());
        }
        let all = self.said.values().map(|(_, said)| said);
        let expected = from_scratch(self.bases.clone(), all);
        prop_assert_eq!(Some(self.domains()), expected);
        prop_assert_eq!(self.store.constraints(), self.said.len());
        Ok(())
    }

    /// Every assignment that satisfies all constraints is within the domains, and what is entailed
    /// agrees with all of them.
    fn compare_with_assignments(&self, asked: &[Said]) -> Result<(), TestCaseError> {
        let variables: Vec<Variable> = self.bases.keys().copied().collect();
        let bases: Vec<Vec<Value>> = self
            .bases
            .values()
            .map(|base| match base {
                Naive::Set(all) => all.iter().copied().collect(),
                Naive::Span(..) => panic!("a narrow domain is a set"),
            })
            .collect();
        let answers: Vec<Option<bool>> = asked
            .iter()
            .map(|(kind, operands)| self.store.entailed(kind, operands))
            .collect();
        let mut at = vec![0; variables.len()];
        loop {
            let value = |operand: &Operand| match operand {
                Operand::Value(value) => *value,
                Operand::Variable(variable) => {
                    let place = variables
                        .iter()
                        .position(|other| other == variable)
                        .unwrap();
                    bases[place][at[place]]
                }
            };
            let is_so = |(kind, operands): &Said| {
                holds(kind, &operands.iter().map(value).collect::<Vec<_>>())
            };
            if self.said.values().all(|(_, said)| is_so(said)) {
                for (place, variable) in variables.iter().enumerate() {
                    let domain = self.store.domain(*variable);
                    prop_assert!(domain.contains(bases[place][at[place]]), "{:?}", domain);
                }
                for (said, answer) in asked.iter().zip(&answers) {
                    let agrees = answer.is_none_or(|answer| answer == is_so(said));
                    prop_assert!(agrees, "{:?} is not {:?}", said, answer);
                }
            }
            let Some(next) = (0..at.len()).find(|&place| at[place] + 1 < bases[place].len()) else {
                return Ok(());
            };
            at[..next].fill(0);
            at[next] += 1;
        }
    }
}

/// Edit by edit beside the rules from scratch; `scale` makes domains narrow or wide.
fn agrees_with_scratch(
    edits: Vec<Edit>,
    scale: i64,
    most: usize,
    asked: &[(Says, Vec<Pick>)],
) -> Result<(), TestCaseError> {
    let mut both = Both {
        store: Store::new(),
        bases: Naives::new(),
        said: AllSaid::new(),
        marks: Vec::new(),
        scale,
        most,
    };
    if scale == HUGE {
        both.store.set_budget(2_000);
    }
    let mut changed = Vec::new();
    for (owner, edit) in (0u32..).zip(edits) {
        let before = both.domains();
        let popped = matches!(edit, Edit::Pop);
        both.apply(owner, edit)?;
        prop_assert_eq!(both.store.depth(), both.marks.len());
        both.compare()?;
        both.store.take_changed(&mut changed);
        for (variable, domain) in both.domains() {
            let differs = before.get(&variable).is_some_and(|old| *old != domain);
            let told = changed.iter().filter(|other| **other == variable).count();
            // What was undone may have been changed there and back.
            prop_assert!(told == usize::from(differs) || popped && told == 1);
        }
        if !asked.is_empty() {
            let asked = asked.iter().map(|(says, on)| both.said(says, on));
            let asked: Option<Vec<Said>> = asked.collect();
            both.compare_with_assignments(&asked.unwrap_or_default())?;
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn edits_of_narrow_domains_agree_with_rules_from_scratch(
        edits in prop::collection::vec(edit(), 1..50),
    ) {
        agrees_with_scratch(edits, 1, 9, &[])?;
    }

    #[test]
    fn edits_of_wide_domains_agree_with_rules_from_scratch(
        edits in prop::collection::vec(edit(), 1..50),
    ) {
        agrees_with_scratch(edits, 13, 9, &[])?;
    }

    /// Nothing overflows, and what is refused or undone leaves everything as it was.
    #[test]
    fn edits_of_the_widest_domains_are_undone(edits in prop::collection::vec(edit(), 1..50)) {
        agrees_with_scratch(edits, HUGE, 9, &[])?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1_000))]

    #[test]
    fn no_assignment_that_fits_is_left_out(
        edits in prop::collection::vec(edit(), 1..30),
        asked in prop::collection::vec(
            (says(), prop::collection::vec((0..1_000usize).prop_map(Pick::Variable), 2..5)),
            1..5,
        ),
    ) {
        agrees_with_scratch(edits, 1, 3, &asked)?;
    }
}
