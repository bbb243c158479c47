//! How constraints narrow domains, until none narrows anything.

use super::trail::Change;
use super::{Constraint, Domain, Kind, Link, NONE, Refusal, Store};
use crate::model::Value;
use crate::temporal::Span;

/// Why rules are not applied any further.
#[derive(Clone, Copy, Debug)]
pub(super) enum Stop {
    /// The constraint in this place leaves a variable without values.
    Conflict(u32),
    OverBudget,
}

/// What a rule finds out at once: an operand has no value left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Empty;

/// What an edit needs while it goes on; kept for its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    /// Variables to be started anew.
    affected: Vec<u32>,
    /// Rows of a table that can be.
    pub(super) live: Vec<u32>,
    pub(super) values: Vec<Value>,
    /// By input of a product: between which numbers the product of those after it lies.
    pub(super) products: Vec<(i128, i128)>,
}

impl<O: Clone> Store<O> {
    /// The rule of a constraint is to be applied.
    pub(super) fn enqueue(&mut self, place: u32) {
        let edge = self.edge_mut(place);
        if !std::mem::replace(&mut edge.queued, true) {
            self.queue.push_back(place);
        }
    }

    /// Applies the rule of a constraint, and then rules until none is left that may narrow
    /// something.
    pub(super) fn propagate_from(&mut self, place: u32) -> Result<(), Stop> {
        let limit = self.work.operations().saturating_add(self.budget);
        self.apply_within(limit, place)?;
        self.propagate_within(limit)
    }

    /// Applies rules until none is left that may narrow something.
    pub(super) fn propagate(&mut self) -> Result<(), Stop> {
        let limit = self.work.operations().saturating_add(self.budget);
        self.propagate_within(limit)
    }

    fn propagate_within(&mut self, limit: u64) -> Result<(), Stop> {
        while let Some(place) = self.queue.pop_front() {
            self.apply_within(limit, place)?;
        }
        Ok(())
    }

    fn apply_within(&mut self, limit: u64, place: u32) -> Result<(), Stop> {
        let outcome = if self.work.operations() >= limit {
            self.edge_mut(place).queued = false;
            Err(Stop::OverBudget)
        } else {
            let outcome = self.apply(place);
            outcome.map_err(|Empty| Stop::Conflict(place))
        };
        if outcome.is_err() {
            self.clear_queue();
        }
        outcome
    }

    fn clear_queue(&mut self) {
        while let Some(place) = self.queue.pop_front() {
            self.edge_mut(place).queued = false;
        }
    }

    /// Why an edit is refused, which added the constraint `refused`.
    pub(super) fn refusal(&mut self, stop: Stop, refused: Option<Constraint>) -> Refusal<O> {
        match stop {
            Stop::Conflict(place) => Refusal::Conflict(self.explain(place, refused)),
            Stop::OverBudget => Refusal::OverBudget {
                operations: self.budget,
            },
        }
    }

    /// Applies the rule of a constraint once.
    #[inline]
    fn apply(&mut self, place: u32) -> Result<(), Empty> {
        let edge = self.edges.at_mut(place as usize);
        let edge = edge.expect("the constraint is there");
        // While it counts as queued, what it narrows does not call for it again.
        let at_once = edge.kind.is_done_at_once();
        edge.queued = at_once;
        let (first, count) = (edge.first, edge.count);
        self.work.rules += 1;
        self.work.operands += u64::from(count);
        let outcome = match &edge.kind {
            Kind::In(domain) => {
                let domain = match self.links.all[first as usize].variable {
                    NONE => None,
                    variable => {
                        let now = &self
                            .nodes
                            .at(variable as usize)
                            .expect("it is there")
                            .domain;
                        let both = now.intersect(domain);
                        (both != *now).then_some(both)
                    }
                };
                match domain {
                    Some(domain) => self.narrow(first, domain),
                    None => self.check_value_in(place, first),
                }
            }
            Kind::Equal => self.equal(first, count),
            Kind::Different => self.different(first),
            Kind::Less => self.ordered(first, 1),
            Kind::AtMost => self.ordered(first, 0),
            Kind::Sum => self.sum(first, count),
            Kind::Product => self.product(first, count),
            Kind::Table(rows) => {
                let rows = rows.clone();
                self.row(first, &rows)
            }
            Kind::Function(call) => {
                let call = *call;
                self.function(first, count, call)
            }
        };
        if at_once {
            self.edge_mut(place).queued = false;
        }
        outcome
    }

    /// A restriction that narrows nothing: its operand may be a value.
    fn check_value_in(&self, place: u32, link: u32) -> Result<(), Empty> {
        let Link {
            variable, value, ..
        } = self.links.all[link as usize];
        match &self.edge(place).kind {
            Kind::In(domain) if variable == NONE && !domain.contains(value) => Err(Empty),
            _ => Ok(()),
        }
    }

    /// Two variables have the same values.
    #[inline]
    fn equal_two(&mut self, links: [u32; 2], variables: [u32; 2]) -> Result<(), Empty> {
        let [a, b] = variables.map(|variable| &self.node(variable).domain);
        if a == b {
            return Ok(());
        }
        let both = a.intersect(b);
        if both.is_empty() {
            return Err(Empty);
        }
        let (less, fewer) = (both != *a, both != *b);
        if less && fewer {
            self.narrow(links[0], both.clone())?;
        }
        // They differ: one of them is narrowed.
        self.narrow(links[usize::from(fewer)], both)
    }

    /// All operands have the same values.
    fn equal(&mut self, first: u32, count: u32) -> Result<(), Empty> {
        if count == 2 {
            let links = [first, first + 1];
            let variables = links.map(|link| self.links.all[link as usize].variable);
            if variables[0] != variables[1] && !variables.contains(&NONE) {
                return self.equal_two(links, variables);
            }
        }
        let mut all = self.domain_of(first);
        for link in first + 1..first + count {
            all = match self.links.all[link as usize] {
                Link {
                    variable: NONE,
                    value,
                    ..
                } => all.intersect(&Domain::exactly(value)),
                Link { variable, .. } => all.intersect(&self.node(variable).domain),
            };
        }
        if all.is_empty() {
            return Err(Empty);
        }
        for link in first..first + count {
            let variable = self.links.all[link as usize].variable;
            if variable != NONE && self.node(variable).domain != all {
                self.narrow(link, all.clone())?;
            }
        }
        Ok(())
    }

    /// The two operands differ.
    fn different(&mut self, first: u32) -> Result<(), Empty> {
        let second = first + 1;
        if self.are_same(first, second) {
            return Err(Empty);
        }
        for (one, other) in [(first, second), (second, first)] {
            let span = self.span_of(one);
            if span.min == span.max && self.can_be(other, span.min) {
                match self.links.all[other as usize].variable {
                    NONE => return Err(Empty),
                    variable => {
                        let now = &self.node(variable).domain;
                        let rest = now.without(span.min);
                        // A value inside a wide interval stays.
                        if rest != *now {
                            self.narrow(other, rest)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// The first operand is at least `gap` below the second: 0 or 1.
    fn ordered(&mut self, first: u32, gap: Value) -> Result<(), Empty> {
        let second = first + 1;
        if self.are_same(first, second) {
            return if gap > 0 { Err(Empty) } else { Ok(()) };
        }
        let max = self.span_of(second).max.checked_sub(gap).ok_or(Empty)?;
        self.narrow_span(first, Span::at_most(max))?;
        let min = self.span_of(first).min.checked_add(gap).ok_or(Empty)?;
        self.narrow_span(second, Span::at_least(min))
    }

    /// The last operand is what a function gives for the others.
    fn function(
        &mut self,
        first: u32,
        count: u32,
        call: fn(&[Value]) -> Option<Value>,
    ) -> Result<(), Empty> {
        let last = first + count - 1;
        self.scratch.values.clear();
        for link in first..last {
            let span = self.span_of(link);
            if span.min != span.max {
                return Ok(());
            }
            self.scratch.values.push(span.min);
        }
        match call(&self.scratch.values) {
            Some(value) if self.can_be(last, value) => self.narrow_span(last, Span::exactly(value)),
            Some(_) => Err(Empty),
            None => Ok(()),
        }
    }

    /// Whether two links are of one variable.
    fn are_same(&self, one: u32, other: u32) -> bool {
        let variable = self.links.all[one as usize].variable;
        variable != NONE && variable == self.links.all[other as usize].variable
    }

    /// Between which values an operand lies.
    #[inline]
    pub(super) fn span_of(&self, link: u32) -> Span {
        match self.links.all[link as usize] {
            Link {
                variable: NONE,
                value,
                ..
            } => Span::exactly(value),
            Link { variable, .. } => self.node(variable).domain.span(),
        }
    }

    /// Which values an operand can have.
    pub(super) fn domain_of(&self, link: u32) -> Domain {
        match self.links.all[link as usize] {
            Link {
                variable: NONE,
                value,
                ..
            } => Domain::exactly(value),
            Link { variable, .. } => self.node(variable).domain.clone(),
        }
    }

    /// Whether an operand can have a value.
    pub(super) fn can_be(&self, link: u32, value: Value) -> bool {
        match self.links.all[link as usize] {
            Link {
                variable: NONE,
                value: only,
                ..
            } => only == value,
            Link { variable, .. } => self.node(variable).domain.contains(value),
        }
    }

    /// An operand lies within a span.
    pub(super) fn narrow_span(&mut self, link: u32, span: Span) -> Result<(), Empty> {
        let now = self.span_of(link);
        let both = now.intersect(span);
        if both == now {
            return Ok(());
        }
        match self.links.all[link as usize].variable {
            NONE => Err(Empty),
            variable => {
                let domain = self.node(variable).domain.within_span(both);
                self.narrow(link, domain)
            }
        }
    }

    /// The variable of a link gets a domain that is less than the one that it has.
    #[inline]
    pub(super) fn narrow(&mut self, link: u32, domain: Domain) -> Result<(), Empty> {
        if domain.is_empty() {
            return Err(Empty);
        }
        let Link {
            variable, narrowed, ..
        } = self.links.all[link as usize];
        if !narrowed {
            self.links.all[link as usize].narrowed = true;
            self.trail.push(Change::Narrowed(link));
        }
        let mut next = self.set(variable, domain);
        while next != NONE {
            let link = self.links.all[next as usize];
            if link.wakes {
                self.enqueue(link.constraint);
            }
            next = link.next;
        }
        Ok(())
    }

    /// Gives a variable a domain; gives the first link in its list.
    #[inline]
    fn set(&mut self, variable: u32, domain: Domain) -> u32 {
        self.work.domains += 1;
        let edit = self.edit;
        let node = self.node_mut(variable);
        let old = std::mem::replace(&mut node.domain, domain);
        let first = node.first;
        if node.kept != edit {
            node.kept = edit;
            self.before.domains.push(old);
            self.trail.push(Change::Domain(variable));
        }
        first
    }

    /// Takes a constraint away, and puts the variables that it had narrowed on the list of those
    /// to be started anew.
    #[inline]
    pub(super) fn loosen(&mut self, constraint: Constraint) {
        assert!(self.has_constraint(constraint), "the constraint is there");
        for link in self.links_of(constraint.index() as u32).rev() {
            self.affect(link);
            self.unlink(link);
        }
        self.detach(constraint);
    }

    /// What a constraint narrowed is to be started anew.
    #[inline]
    fn affect(&mut self, link: u32) {
        let Link {
            variable, narrowed, ..
        } = self.links.all[link as usize];
        if narrowed {
            let node = self.node_mut(variable);
            if !std::mem::replace(&mut node.marked, true) {
                self.scratch.affected.push(variable);
            }
        }
    }

    /// Starts anew the variables on the list, and those that their constraints had narrowed, and
    /// so on. All others have their domains from constraints that none of these have a part in.
    pub(super) fn start_anew(&mut self) {
        let mut at = 0;
        while let Some(&variable) = self.scratch.affected.get(at) {
            at += 1;
            let base = self.node(variable).base.clone();
            let mut next = self.set(variable, base);
            while next != NONE {
                let link = self.links.all[next as usize];
                self.work.operands += 1;
                if link.narrowed {
                    self.links.all[next as usize].narrowed = false;
                    self.trail.push(Change::Widened(next));
                }
                self.enqueue(link.constraint);
                if link.wakes {
                    for other in self.links_of(link.constraint) {
                        self.affect(other);
                    }
                }
                next = link.next;
            }
        }
        while let Some(variable) = self.scratch.affected.pop() {
            self.node_mut(variable).marked = false;
        }
        // Fewer constraints leave no fewer values: only where rules were left out before can one
        // find now that nothing fits.
        if !self.queue.is_empty() && self.propagate().is_err() {
            self.unfinished = true;
        }
    }
}
