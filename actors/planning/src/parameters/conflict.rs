//! Why an edit was refused: constraints that cannot all hold.

use std::fmt;

use super::{Constraint, Domain, Kind, NONE, Operand, Store, Variable};

/// Why an edit was refused.
#[derive(Clone, Debug, thiserror::Error)]
pub enum Refusal<O> {
    /// Some constraints cannot all hold.
    #[error(transparent)]
    Conflict(#[from] Conflict<O>),
    /// The edit took more operations than the budget.
    #[error("the constraints are not applied to the end within {operations} operations")]
    OverBudget {
        /// The budget.
        operations: u64,
    },
}

impl<O> Refusal<O> {
    /// The conflict, if it is one.
    pub fn conflict(self) -> Option<Conflict<O>> {
        match self {
            Refusal::Conflict(conflict) => Some(conflict),
            Refusal::OverBudget { .. } => None,
        }
    }
}

/// A constraint of a conflict.
#[derive(Clone, Debug)]
pub struct Part<O> {
    /// Which constraint; none if it is the one that was refused.
    pub constraint: Option<Constraint>,
    /// Whose it is.
    pub owner: O,
    /// What it says.
    pub kind: Kind,
    /// Of what.
    pub operands: Vec<Operand>,
}

/// Constraints that cannot all hold, whatever else does. It stands for itself: the store may have
/// changed since.
#[derive(Clone, Debug)]
pub struct Conflict<O> {
    /// The constraints, the one whose rule failed first.
    pub parts: Vec<Part<O>>,
    /// Whether it is known that without any one of the parts, the rules find no conflict.
    pub is_minimal: bool,
    /// The variables in question with their domains without any constraint, in rising order.
    variables: Vec<(Variable, Domain)>,
}

impl<O> Conflict<O> {
    /// Whose constraints cannot all hold, those of the parts in their order.
    pub fn owners(&self) -> impl Iterator<Item = &O> {
        self.parts.iter().map(|part| &part.owner)
    }
}

impl<O: Clone> Conflict<O> {
    /// Leaves out parts as long as the rest conflicts, by trying each: what is left is not the
    /// smallest conflict, but none of its parts can be left out.
    ///
    /// A try that takes more than `operations` is one in which nothing was found: the part stays,
    /// and the result is not known to be minimal.
    ///
    /// ```
    /// use farside_planning::parameters::{Domain, Kind, Store};
    /// use farside_planning::temporal::Span;
    /// let mut store = Store::new();
    /// let heat = store.add(Span::new(0, 100).into());
    /// store.restrict(heat, Span::at_most(60).into(), "by day")?;
    /// store.restrict(heat, Span::at_most(40).into(), "by night")?;
    /// let refused = store.restrict(heat, Span::at_least(50).into(), "to work");
    /// let conflict = refused.unwrap_err().conflict().unwrap();
    /// assert_eq!(conflict.parts.len(), 3);
    /// let owners: Vec<_> = conflict.minimal(10_000).owners().copied().collect();
    /// assert_eq!(owners, ["to work", "by night"]);
    /// # Ok::<(), farside_planning::parameters::Refusal<&str>>(())
    /// ```
    #[must_use]
    pub fn minimal(&self, operations: u64) -> Conflict<O> {
        let mut kept: Vec<usize> = (0..self.parts.len()).collect();
        let mut is_minimal = true;
        // All parts before this one are in every conflict among those that are kept.
        let mut needed = 0;
        while needed < kept.len() {
            let mut rest = kept.clone();
            rest.remove(needed);
            match self.conflict_among(&rest, operations) {
                Ok(Some(fewer)) => kept = fewer,
                Ok(None) => needed += 1,
                Err(()) => {
                    needed += 1;
                    is_minimal = false;
                }
            }
            // A part that could not be tried may have gone with another one.
            needed = needed.min(kept.len());
        }
        Conflict {
            parts: kept.iter().map(|&at| self.parts[at].clone()).collect(),
            is_minimal,
            variables: self.variables.clone(),
        }
    }

    /// Which of some parts conflict, in rising order, if any do.
    fn conflict_among(&self, parts: &[usize], operations: u64) -> Result<Option<Vec<usize>>, ()> {
        let mut store = Store::new();
        let places: Vec<Variable> = self
            .variables
            .iter()
            .map(|(_, domain)| store.add(domain.clone()))
            .collect();
        for &at in parts {
            let left = operations.saturating_sub(store.work().operations());
            store.set_budget(left);
            let part = &self.parts[at];
            let place = |operand: &Operand| match operand {
                Operand::Value(value) => Operand::Value(*value),
                Operand::Variable(variable) => {
                    let found = self.variables.binary_search_by_key(variable, |one| one.0);
                    Operand::Variable(places[found.expect("kept with the conflict")])
                }
            };
            let operands: Vec<Operand> = part.operands.iter().map(place).collect();
            match store.post(part.kind.clone(), &operands, at) {
                Ok(_) => {}
                Err(Refusal::OverBudget { .. }) => return Err(()),
                Err(Refusal::Conflict(conflict)) => {
                    let mut fewer: Vec<usize> = conflict.owners().copied().collect();
                    fewer.sort_unstable();
                    return Ok(Some(fewer));
                }
            }
        }
        Ok(None)
    }
}

impl<O: fmt::Debug> fmt::Display for Conflict<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("these cannot all hold:")?;
        for part in &self.parts {
            write!(f, " {:?} [{:?} of", part.owner, part.kind)?;
            for operand in &part.operands {
                match operand {
                    Operand::Value(value) => write!(f, " {value}")?,
                    Operand::Variable(variable) => write!(f, " ?{variable:?}")?,
                }
            }
            f.write_str("]")?;
        }
        Ok(())
    }
}

impl<O: fmt::Debug> std::error::Error for Conflict<O> {}

impl<O: Clone> Store<O> {
    /// The rule of a constraint left a variable without values: it, all that narrowed its
    /// variables, all that narrowed the variables of those, and so on. With these alone, domains
    /// are as narrow.
    ///
    /// `refused` is the constraint that will be gone.
    pub(super) fn explain(&mut self, failed: u32, refused: Option<Constraint>) -> Conflict<O> {
        let (mut found, mut variables) = (vec![failed], Vec::new());
        self.edge_mut(failed).marked = true;
        let mut at = 0;
        while let Some(&constraint) = found.get(at) {
            at += 1;
            for link in self.links_of(constraint) {
                let variable = self.links.all[link as usize].variable;
                if variable == NONE || self.node(variable).marked {
                    continue;
                }
                self.node_mut(variable).marked = true;
                variables.push(variable);
                let mut next = self.node(variable).first;
                while next != NONE {
                    let link = self.links.all[next as usize];
                    let edge = self.edge_mut(link.constraint);
                    if link.narrowed && !std::mem::replace(&mut edge.marked, true) {
                        found.push(link.constraint);
                    }
                    next = link.next;
                }
            }
        }
        variables.sort_unstable();
        let mut bases = Vec::with_capacity(variables.len());
        for place in variables {
            let id = self.nodes.id_at(place as usize);
            let node = self.node_mut(place);
            node.marked = false;
            bases.extend(id.map(|id| (id, node.base.clone())));
        }
        let mut parts = Vec::with_capacity(found.len());
        for place in found {
            self.edge_mut(place).marked = false;
            let links = self.links_of(place);
            let id = self.edges.id_at(place as usize);
            parts.push(Part {
                constraint: id.filter(|_| id != refused),
                owner: self.owners[place as usize].clone(),
                kind: self.edge(place).kind.clone(),
                operands: links.map(|link| self.operand(link)).collect(),
            });
        }
        Conflict {
            parts,
            is_minimal: false,
            variables: bases,
        }
    }
}
