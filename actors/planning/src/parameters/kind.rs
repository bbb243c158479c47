//! What constraints say, and of what.

use super::{Domain, Rows, Variable};
use crate::model::{Function, RelationshipKind, Value};

/// What a constraint says of its operands.
///
/// Sums and products are those of whole numbers without bounds: what a domain cannot hold, no
/// variable can be.
#[derive(Clone, Debug)]
pub enum Kind {
    /// The one is in a domain.
    In(Domain),
    /// All are equal: one or more.
    Equal,
    /// The two are not.
    Different,
    /// The first is less than the second.
    Less,
    /// The first is at most the second.
    AtMost,
    /// The last is the sum of the others.
    Sum,
    /// The last is the product of the others.
    Product,
    /// They are a row of a table.
    Table(Rows),
    /// The last is what a pure function gives for the others, once they have values. While it gives
    /// nothing, nothing is said of the last.
    Function(fn(&[Value]) -> Option<Value>),
}

impl Kind {
    /// What a model says, with its tables and functions.
    ///
    /// ```
    /// use farside_planning::model::{RelationshipKind, Table};
    /// use farside_planning::parameters::{Kind, Rows};
    /// let table = Table { name: "even".into(), columns: 1, rows: vec![0, 2, 4] };
    /// let kind = Kind::of(RelationshipKind::Table(0), &[Rows::from(&table)], &[]);
    /// assert!(kind.takes(1) && !kind.takes(2));
    /// ```
    ///
    /// # Panics
    ///
    /// If the model has no such table or function.
    pub fn of(kind: RelationshipKind, tables: &[Rows], functions: &[Function]) -> Kind {
        match kind {
            RelationshipKind::Equal => Kind::Equal,
            RelationshipKind::Different => Kind::Different,
            RelationshipKind::Less => Kind::Less,
            RelationshipKind::AtMost => Kind::AtMost,
            RelationshipKind::Sum => Kind::Sum,
            RelationshipKind::Product => Kind::Product,
            RelationshipKind::Table(place) => Kind::Table(tables[place].clone()),
            RelationshipKind::Function(place) => Kind::Function(functions[place].call),
        }
    }

    /// Whether it can be said of so many operands.
    #[inline]
    pub fn takes(&self, operands: usize) -> bool {
        match self {
            Kind::In(_) => operands == 1,
            Kind::Equal | Kind::Sum | Kind::Product | Kind::Function(_) => operands >= 1,
            Kind::Different | Kind::Less | Kind::AtMost => operands == 2,
            Kind::Table(rows) => operands == rows.columns(),
        }
    }

    /// Whether its rule, applied twice in a row, finds no more than when applied once.
    #[inline]
    pub(super) fn is_done_at_once(&self) -> bool {
        use Kind::{AtMost, Different, Equal, In, Less};
        matches!(self, In(_) | Equal | Different | Less | AtMost)
    }
}

/// What a constraint speaks of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operand {
    /// A value.
    Value(Value),
    /// A variable.
    Variable(Variable),
}

impl From<Variable> for Operand {
    fn from(variable: Variable) -> Operand {
        Operand::Variable(variable)
    }
}

impl From<Value> for Operand {
    fn from(value: Value) -> Operand {
        Operand::Value(value)
    }
}
