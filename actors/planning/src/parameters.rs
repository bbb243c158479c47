//! Parametric constraints: variables with domains of whole numbers, and what ties them together.
//!
//! A [`Store`] knows of each variable the values that it can have, and keeps them up to date edit
//! by edit: with a new constraint, and when one is retracted, in any order. An edit that leaves a
//! variable without values is refused, changes nothing, and is explained by constraints that cannot
//! all hold.
//!
//! # How it works
//!
//! Each constraint narrows the domains of its variables by a rule of its own, and all rules are
//! applied until none narrows anything. The rules only ever narrow more where there is less to begin
//! with, so the result does not depend on the order; that is always the same, first in, first out.
//! Equality, difference, restrictions and tables narrow domains to exactly the values that some
//! assignment of their own has; comparisons, sums and products narrow the ends (K. Apt, *The Essence
//! of Constraint Propagation*, 1999). A wide interval keeps all between its ends: see [`Domain`].
//! What the rules find is certain, but they do not find all: domains can be left that no assignment
//! satisfies.
//!
//! The store notes which constraints narrowed a variable. A retraction starts anew only the
//! variables that the constraint narrowed, those that they in turn had narrowed, and so on, and
//! applies the rules of the constraints that these have (as A. Jónsson and J. Frank's procedural
//! constraints do, and B. Neveu and P. Berlandier, *Maintaining Arc Consistency through Constraint
//! Retraction*, 1994). Equality is a constraint like the others: that two variables are made equal
//! costs what changes by it, and so does that they are parted again.

mod arithmetic;
mod conflict;
mod domain;
mod entailed;
mod kind;
mod propagate;
mod table;
#[cfg(test)]
mod tests;
mod trail;

use std::collections::VecDeque;
use std::fmt;

pub use conflict::{Conflict, Part, Refusal};
pub use domain::Domain;
pub use kind::{Kind, Operand};
pub use table::Rows;

use crate::arena::{Arena, Id};
use crate::model::Value;
use propagate::Scratch;
use trail::{Before, Change, Links, Mark};

/// A variable.
pub type Variable = Id<Node>;

/// A constraint, or a restriction of a variable's domain.
pub type Constraint = Id<Edge>;

/// What the store keeps of a variable.
#[derive(Clone, Debug)]
pub struct Node {
    domain: Domain,
    /// The domain without any constraint.
    base: Domain,
    /// The first link in its list.
    first: u32,
    /// In which edit its domain was kept last, to be put back.
    kept: u64,
    /// Whether it is on the list of changed variables.
    told: bool,
    /// Whether it is on a list of the edit that goes on.
    marked: bool,
}

/// What the store keeps of a constraint, but for its owner.
#[derive(Clone, Debug)]
pub struct Edge {
    kind: Kind,
    /// Its first link; the others follow it.
    first: u32,
    /// How many links it has.
    count: u32,
    queued: bool,
    /// Whether it is on a list of the edit that goes on.
    marked: bool,
}

/// No link, or no variable.
const NONE: u32 = u32::MAX;

/// An operand of a constraint, with its neighbours in the list of its variable.
#[derive(Clone, Copy, Debug)]
struct Link {
    /// The place of its variable; none, if it is a value.
    variable: u32,
    constraint: u32,
    next: u32,
    before: u32,
    value: Value,
    /// Whether the constraint narrowed the variable since that was started anew.
    narrowed: bool,
    /// Whether the rule of the constraint depends on the variable's domain.
    wakes: bool,
}

impl Link {
    const UNUSED: Link = Link {
        variable: NONE,
        constraint: NONE,
        next: NONE,
        before: NONE,
        value: 0,
        narrowed: false,
        wakes: false,
    };
}

/// How much edits did: counts that say whether work follows the change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// How often a constraint's rule was applied.
    pub rules: u64,
    /// How often a rule looked at an operand.
    pub operands: u64,
    /// How often a rule looked at a row of a table.
    pub rows: u64,
    /// How often a variable's domain was narrowed or started anew.
    pub domains: u64,
}

impl Work {
    /// All together: what a budget is about.
    #[inline]
    pub fn operations(&self) -> u64 {
        self.rules + self.operands + self.rows + self.domains
    }
}

/// Variables, and constraints between them. `O` says whose a constraint is: a token, a line of a
/// model.
///
/// ```
/// use farside_planning::parameters::{Domain, Kind, Refusal, Store};
/// use farside_planning::temporal::Span;
/// let mut store = Store::new();
/// let [distance, speed, time] = [0, 1, 2].map(|_| store.add(Span::new(0, 1_000).into()));
/// store.post(Kind::Product, &[speed.into(), time.into(), distance.into()], "drive")?;
/// let fast = store.restrict(speed, Span::new(5, 10).into(), "on the plain")?;
/// store.restrict(distance, Domain::exactly(300), "to the crater")?;
/// assert_eq!(store.domain(time).span(), Span::new(30, 60));
/// let refused = store.post(Kind::Less, &[time.into(), 20.into()], "before dusk");
/// let Err(Refusal::Conflict(conflict)) = refused else { panic!("it takes 30 ticks") };
/// let owners: Vec<_> = conflict.owners().copied().collect();
/// assert_eq!(owners, ["before dusk", "drive", "on the plain", "to the crater"]);
/// store.retract(fast);
/// assert_eq!(store.domain(time).span(), Span::new(1, 300));
/// # Ok::<(), Refusal<&str>>(())
/// ```
#[derive(Clone)]
pub struct Store<O> {
    nodes: Arena<Node>,
    edges: Arena<Edge>,
    /// By the place of a constraint.
    owners: Vec<O>,
    links: Links,
    /// Constraints whose rules are to be applied.
    queue: VecDeque<u32>,
    scratch: Scratch,
    trail: Vec<Change>,
    before: Before<O>,
    levels: Vec<Mark>,
    /// The number of the edit that goes on.
    edit: u64,
    changed: Vec<Variable>,
    /// Whether a retraction went over the budget, so that rules may be left to be applied.
    unfinished: bool,
    budget: u64,
    work: Work,
}

/// How many operations an edit may take if nothing else is said.
pub const BUDGET: u64 = 1_000_000;

impl<O: Clone> Default for Store<O> {
    fn default() -> Self {
        Store {
            nodes: Arena::new(),
            edges: Arena::new(),
            owners: Vec::new(),
            links: Links::default(),
            queue: VecDeque::new(),
            scratch: Scratch::default(),
            trail: Vec::new(),
            before: Before::default(),
            levels: Vec::new(),
            edit: 0,
            changed: Vec::new(),
            unfinished: false,
            budget: BUDGET,
            work: Work::default(),
        }
    }
}

impl<O: Clone> Store<O> {
    /// Without variables.
    pub fn new() -> Self {
        Store::default()
    }

    /// From now on an edit may take so many [operations](Work::operations); [`BUDGET`] at first.
    pub fn set_budget(&mut self, operations: u64) {
        self.budget = operations;
    }

    /// How many variables there are.
    pub fn variables(&self) -> usize {
        self.nodes.len()
    }

    /// How many constraints there are, restrictions among them.
    pub fn constraints(&self) -> usize {
        self.edges.len()
    }

    /// A new variable.
    ///
    /// # Panics
    ///
    /// If the domain is empty.
    pub fn add(&mut self, domain: Domain) -> Variable {
        assert!(!domain.is_empty(), "a variable has values");
        let variable = self.nodes.insert(Node {
            base: domain.clone(),
            domain,
            first: NONE,
            kept: 0,
            told: false,
            marked: false,
        });
        if !self.levels.is_empty() {
            self.trail.push(Change::VariableAdded(variable));
        }
        variable
    }

    /// Removes a variable: [`remove_all`](Self::remove_all) with one.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn remove(&mut self, variable: Variable) -> bool {
        self.remove_all(&[variable])
    }

    /// Removes variables, with the constraints that they have. It says whether the rules were
    /// applied to the end, as [`retract_all`](Self::retract_all) does.
    ///
    /// # Panics
    ///
    /// If one of them is not there.
    pub fn remove_all(&mut self, variables: &[Variable]) -> bool {
        if let &[variable] = variables
            && self.is_apart(variable)
        {
            // Nobody is told.
            self.take_out(variable);
            return !self.unfinished;
        }
        let mark = self.begin();
        for &variable in variables {
            let node = self.nodes.get_mut(variable);
            // So that none is started anew with what the others had narrowed.
            node.expect("the variable is there").marked = true;
        }
        for &variable in variables {
            loop {
                let link = self.node(variable.index() as u32).first;
                if link == NONE {
                    break;
                }
                let constraint = self.links.all[link as usize].constraint as usize;
                let id = self.edges.id_at(constraint);
                self.loosen(id.expect("a variable's constraints are there"));
            }
            self.take_out(variable);
        }
        self.start_anew();
        self.settle(mark);
        !self.unfinished
    }

    /// Whether a variable is there.
    pub fn has(&self, variable: Variable) -> bool {
        self.nodes.get(variable).is_some()
    }

    /// Whether a variable has no constraints.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn is_apart(&self, variable: Variable) -> bool {
        let node = self.nodes.get(variable);
        node.expect("the variable is there").first == NONE
    }

    /// The values that a variable can have.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn domain(&self, variable: Variable) -> &Domain {
        let node = self.nodes.get(variable);
        &node.expect("the variable is there").domain
    }

    /// The value of a variable, if it has only one.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn value(&self, variable: Variable) -> Option<Value> {
        self.domain(variable).value()
    }

    /// Adds a constraint.
    ///
    /// # Errors
    ///
    /// If a variable has no value any more, or if that takes more operations than the budget: the
    /// store is as before.
    ///
    /// # Panics
    ///
    /// If a variable is not there, or if the kind does not [take](Kind::takes) so many operands.
    pub fn post(
        &mut self,
        kind: Kind,
        operands: &[Operand],
        owner: O,
    ) -> Result<Constraint, Refusal<O>> {
        assert!(
            kind.takes(operands.len()),
            "{kind:?} is not said of {} operands",
            operands.len()
        );
        let mark = self.begin();
        let constraint = self.attach(kind, operands, owner);
        match self.propagate_from(constraint.index() as u32) {
            Ok(()) => {
                self.settle(mark);
                Ok(constraint)
            }
            Err(stop) => {
                let refusal = self.refusal(stop, Some(constraint));
                self.undo_to(mark, false);
                Err(refusal)
            }
        }
    }

    /// Adds the constraint that a variable is in a domain: `post` with [`Kind::In`].
    ///
    /// # Errors
    ///
    /// If a variable has no value any more, or if that takes more operations than the budget: the
    /// store is as before.
    ///
    /// # Panics
    ///
    /// If the variable is not there.
    pub fn restrict(
        &mut self,
        variable: Variable,
        domain: Domain,
        owner: O,
    ) -> Result<Constraint, Refusal<O>> {
        self.post(Kind::In(domain), &[variable.into()], owner)
    }

    /// Takes a constraint away, whenever it was added: [`retract_all`](Self::retract_all) with one.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn retract(&mut self, constraint: Constraint) -> bool {
        self.retract_all([constraint])
    }

    /// Takes constraints away together, whenever they were added.
    ///
    /// It says whether the rules were applied to the end. If that would take more operations than
    /// the budget, it is broken off: then no value is missing from a domain, but a domain may have
    /// values that the rules would leave out, until [`resume`](Self::resume).
    ///
    /// # Panics
    ///
    /// If one of them is not there.
    pub fn retract_all(&mut self, constraints: impl IntoIterator<Item = Constraint>) -> bool {
        let mark = self.begin();
        for constraint in constraints {
            self.loosen(constraint);
        }
        self.start_anew();
        self.settle(mark);
        !self.unfinished
    }

    /// Applies all rules, where a retraction was broken off.
    ///
    /// # Errors
    ///
    /// If a variable has no value any more, or if that takes more operations than the budget: the
    /// store is as before.
    pub fn resume(&mut self) -> Result<(), Refusal<O>> {
        let mark = self.begin();
        for place in 0..self.edges.places() {
            if self.edges.at(place).is_some() {
                self.enqueue(place as u32);
            }
        }
        match self.propagate() {
            Ok(()) => {
                self.unfinished = false;
                self.settle(mark);
                Ok(())
            }
            Err(stop) => {
                let refusal = self.refusal(stop, None);
                self.undo_to(mark, false);
                Err(refusal)
            }
        }
    }

    /// Whether all rules were applied to the end.
    pub fn is_finished(&self) -> bool {
        !self.unfinished
    }

    /// The constraints of a variable, the last one first.
    ///
    /// # Panics
    ///
    /// If it is not there.
    pub fn constraints_of(&self, variable: Variable) -> impl Iterator<Item = Constraint> + '_ {
        let node = self.nodes.get(variable).expect("the variable is there");
        let after = |link: u32| (link != NONE).then_some(link);
        let links = std::iter::successors(after(node.first), move |&link| {
            after(self.links.all[link as usize].next)
        });
        links.filter_map(|link| {
            let constraint = self.links.all[link as usize].constraint;
            self.edges.id_at(constraint as usize)
        })
    }

    /// Whether a constraint is there.
    pub fn has_constraint(&self, constraint: Constraint) -> bool {
        self.edges.get(constraint).is_some()
    }

    /// What a constraint says, if it is there.
    pub fn kind(&self, constraint: Constraint) -> Option<&Kind> {
        Some(&self.edges.get(constraint)?.kind)
    }

    /// What a constraint speaks of; nothing if it is not there.
    pub fn operands(&self, constraint: Constraint) -> impl Iterator<Item = Operand> + '_ {
        let edge = self.edges.get(constraint);
        let links = edge.map_or(0..0, |_| self.links_of(constraint.index() as u32));
        links.map(|link| self.operand(link))
    }

    /// Whose a constraint is, if it is there.
    pub fn owner(&self, constraint: Constraint) -> Option<&O> {
        self.edges.get(constraint)?;
        self.owners.get(constraint.index())
    }

    /// The variables whose domains changed since this was asked last and that are still there, in
    /// the order in which they first did. New variables are not among them until they change.
    pub fn take_changed(&mut self, into: &mut Vec<Variable>) {
        into.clear();
        std::mem::swap(into, &mut self.changed);
        self.take_told(into);
    }

    /// Whether there are variables whose domains changed since this was asked last.
    pub fn has_changed(&self) -> bool {
        !self.changed.is_empty()
    }

    /// All variables and their domains, place by place, for comparing whole states.
    pub fn all_domains(&self) -> impl Iterator<Item = (Variable, &Domain)> {
        self.nodes.iter().map(|(id, node)| (id, &node.domain))
    }

    /// All constraints with their owners, place by place.
    pub fn all_constraints(&self) -> impl Iterator<Item = (Constraint, &O)> {
        let edges = self.edges.iter();
        edges.map(|(id, _)| (id, &self.owners[id.index()]))
    }

    /// How much was done since the store was made.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Puts a constraint into its variables' lists.
    fn attach(&mut self, kind: Kind, operands: &[Operand], owner: O) -> Constraint {
        // A restriction holds whatever its variable loses.
        let wakes = !matches!(kind, Kind::In(_));
        let count = u32::try_from(operands.len()).expect("fewer than 2^32 operands");
        let first = self.links.take(count);
        let constraint = self.edges.insert(Edge {
            kind,
            first,
            count,
            queued: false,
            marked: false,
        });
        let place = constraint.index();
        if place == self.owners.len() {
            self.owners.push(owner);
        } else {
            self.owners[place] = owner;
        }
        for (link, operand) in (first..).zip(operands) {
            let (variable, value) = match *operand {
                Operand::Value(value) => (NONE, value),
                Operand::Variable(variable) => {
                    assert!(self.has(variable), "the variable is there");
                    (variable.index() as u32, 0)
                }
            };
            self.links.all[link as usize] = Link {
                variable,
                constraint: place as u32,
                value,
                wakes,
                ..Link::UNUSED
            };
            if variable != NONE {
                self.link(link);
            }
        }
        self.trail.push(Change::Posted(constraint));
        constraint
    }

    /// The node in a place, which is there: links are of variables that are.
    fn node(&self, place: u32) -> &Node {
        self.nodes
            .at(place as usize)
            .expect("the variable is there")
    }

    fn node_mut(&mut self, place: u32) -> &mut Node {
        let node = self.nodes.at_mut(place as usize);
        node.expect("the variable is there")
    }

    /// The edge in a place, which is there.
    fn edge(&self, place: u32) -> &Edge {
        self.edges
            .at(place as usize)
            .expect("the constraint is there")
    }

    fn edge_mut(&mut self, place: u32) -> &mut Edge {
        let edge = self.edges.at_mut(place as usize);
        edge.expect("the constraint is there")
    }

    /// The links of the constraint in a place.
    fn links_of(&self, place: u32) -> std::ops::Range<u32> {
        let edge = self.edge(place);
        edge.first..edge.first + edge.count
    }

    /// What a link stands for.
    fn operand(&self, link: u32) -> Operand {
        let link = &self.links.all[link as usize];
        match self.nodes.id_at(link.variable as usize) {
            Some(variable) if link.variable != NONE => Operand::Variable(variable),
            _ => Operand::Value(link.value),
        }
    }
}

impl<O> fmt::Debug for Store<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Store")
            .field("variables", &self.nodes.len())
            .field("constraints", &self.edges.len())
            .finish_non_exhaustive()
    }
}
