//! Whether something holds already, whatever values the variables get.

use std::collections::BTreeSet;

use smallvec::SmallVec;

use super::arithmetic::times;
use super::{Domain, Kind, NONE, Operand, Store, Variable};
use crate::model::Value;
use crate::temporal::Span;

impl<O: Clone> Store<O> {
    /// Whether a constraint, were it posted, would certainly hold or certainly not; none if that is
    /// undecided. Domains decide, and which variables have been made equal. Nothing is changed.
    ///
    /// ```
    /// use farside_planning::parameters::{Domain, Kind, Store};
    /// let mut store = Store::new();
    /// let tilt = store.add(Domain::of([0, 1, 2, 3]));
    /// let is_alarm = |store: &Store<&str>| store.entailed(&Kind::Less, &[2.into(), tilt.into()]);
    /// assert_eq!(is_alarm(&store), None);
    /// store.restrict(tilt, Domain::exactly(3), "a measurement").unwrap();
    /// assert_eq!(is_alarm(&store), Some(true));
    /// ```
    ///
    /// # Panics
    ///
    /// If a variable is not there, or if the kind does not [take](Kind::takes) so many operands.
    pub fn entailed(&self, kind: &Kind, operands: &[Operand]) -> Option<bool> {
        assert!(
            kind.takes(operands.len()),
            "{kind:?} is not said of {} operands",
            operands.len()
        );
        match kind {
            Kind::In(domain) => self.is_in(operands[0], domain),
            Kind::Equal => self.are_equal(operands),
            Kind::Different => self.are_equal(operands).map(|equal| !equal),
            Kind::Less => self.are_ordered(operands, true),
            Kind::AtMost => self.are_ordered(operands, false),
            Kind::Sum => {
                let (last, inputs) = operands.split_last()?;
                let add = |sum: (i128, i128), with: (i128, i128)| (sum.0 + with.0, sum.1 + with.1);
                let sum = inputs
                    .iter()
                    .fold((0, 0), |sum, &x| add(sum, self.range(x)));
                is_one(sum, self.range(*last), || self.may_be_all(*last, sum))
            }
            Kind::Product => {
                let (last, inputs) = operands.split_last()?;
                let product = inputs.iter();
                let product = product.fold((1, 1), |all, &x| times(all, self.range(x)));
                is_one(product, self.range(*last), || {
                    self.may_be_all(*last, product)
                })
            }
            Kind::Table(rows) => self.is_row(rows, operands),
            Kind::Function(call) => {
                let (last, inputs) = operands.split_last()?;
                let values: Option<SmallVec<[Value; 4]>> =
                    inputs.iter().map(|&x| self.bound(x)).collect();
                let value = call(&values?)?;
                match self.bound(*last) {
                    Some(bound) => Some(bound == value),
                    None => (!self.may_be(*last, value)).then_some(false),
                }
            }
        }
    }

    fn is_in(&self, operand: Operand, domain: &Domain) -> Option<bool> {
        if let Some(value) = self.bound(operand) {
            return Some(domain.contains(value));
        }
        let now = self.values_of(operand);
        let both = now.intersect(domain);
        if both.is_empty() {
            return Some(false);
        }
        (both.span() == now.span() && both.len() == now.len()).then_some(true)
    }

    fn are_equal(&self, operands: &[Operand]) -> Option<bool> {
        let (&first, others) = operands.split_first()?;
        if let &[second] = others {
            let spans = (self.span(first), self.span(second));
            if spans.0.intersect(spans.1).is_empty() {
                return Some(false);
            }
            if self.bound(first).is_some() && spans.0 == spans.1 {
                return Some(true);
            }
        }
        let mut all = self.values_of(first);
        for &other in others {
            all = all.intersect(&self.values_of(other));
        }
        if all.is_empty() {
            return Some(false);
        }
        let same = |&other: &Operand| {
            let known = self.bound(first).is_some() && self.bound(first) == self.bound(other);
            known || self.are_one(first, other)
        };
        others.iter().all(same).then_some(true)
    }

    fn are_ordered(&self, operands: &[Operand], strictly: bool) -> Option<bool> {
        let (a, b) = (operands[0], operands[1]);
        let (first, second) = (self.span(a), self.span(b));
        let (holds, fails) = if strictly {
            (first.max < second.min, first.min >= second.max)
        } else {
            (first.max <= second.min, first.min > second.max)
        };
        match (holds, fails) {
            (true, _) => Some(true),
            (_, true) => Some(false),
            // Of equal ones, the first is at most the second, and not less.
            _ => self.are_one(a, b).then_some(!strictly),
        }
    }

    /// Whether constraints make one of two variables.
    fn are_one(&self, a: Operand, b: Operand) -> bool {
        let (Operand::Variable(a), Operand::Variable(b)) = (a, b) else {
            return false;
        };
        if a == b {
            return true;
        }
        let place = |variable: Variable| variable.index() as u32;
        let mut found = BTreeSet::from([place(a)]);
        let mut next = vec![place(a)];
        while let Some(variable) = next.pop() {
            if variable == place(b) {
                return true;
            }
            let mut link = self.node(variable).first;
            while link != NONE {
                let constraint = self.links.all[link as usize].constraint;
                if matches!(self.edge(constraint).kind, Kind::Equal) {
                    for other in self.links_of(constraint) {
                        let other = self.links.all[other as usize].variable;
                        if other != NONE && found.insert(other) {
                            next.push(other);
                        }
                    }
                }
                link = self.links.all[link as usize].next;
            }
        }
        false
    }

    fn values_of(&self, operand: Operand) -> Domain {
        match operand {
            Operand::Value(value) => Domain::exactly(value),
            Operand::Variable(variable) => self.domain(variable).clone(),
        }
    }

    fn bound(&self, operand: Operand) -> Option<Value> {
        match operand {
            Operand::Value(value) => Some(value),
            Operand::Variable(variable) => self.value(variable),
        }
    }

    pub(super) fn span(&self, operand: Operand) -> Span {
        match operand {
            Operand::Value(value) => Span::exactly(value),
            Operand::Variable(variable) => self.domain(variable).span(),
        }
    }

    fn range(&self, operand: Operand) -> (i128, i128) {
        let Span { min, max } = self.span(operand);
        (min.into(), max.into())
    }

    pub(super) fn may_be(&self, operand: Operand, value: Value) -> bool {
        match operand {
            Operand::Value(only) => only == value,
            Operand::Variable(variable) => self.domain(variable).contains(value),
        }
    }

    /// How many values an operand can have.
    pub(super) fn size(&self, operand: Operand) -> u64 {
        match operand {
            Operand::Value(_) => 1,
            Operand::Variable(variable) => self.domain(variable).len(),
        }
    }

    /// Whether an operand can be one of a range, or that is more than one number.
    fn may_be_all(&self, operand: Operand, range: (i128, i128)) -> bool {
        match Value::try_from(range.0) {
            Ok(value) if range.0 == range.1 => self.may_be(operand, value),
            _ => true,
        }
    }
}

/// Whether a number of one range is certainly one of another, or certainly not.
fn is_one(a: (i128, i128), b: (i128, i128), may_be: impl Fn() -> bool) -> Option<bool> {
    if a.1 < b.0 || b.1 < a.0 || !may_be() {
        return Some(false);
    }
    (a.0 == a.1 && b == a).then_some(true)
}
