//! Relations whose rows are listed.

use std::ops::Range;
use std::sync::Arc;

use super::propagate::Empty;
use super::{Domain, NONE, Operand, Store};
use crate::model::{Table, Value};
use crate::temporal::Span;

/// The rows of a table, which copies share.
///
/// ```
/// use farside_planning::parameters::{Domain, Kind, Refusal, Rows, Store};
/// // How a surface limits the speed.
/// let rows = Rows::new(2, &[0, 5, 1, 5, 1, 10]);
/// let mut store = Store::new();
/// let surface = store.add(Domain::of([0, 1]));
/// let speed = store.add(Domain::of([0, 5, 10]));
/// store.post(Kind::Table(rows), &[surface.into(), speed.into()], "traction")?;
/// assert_eq!(store.domain(speed), &Domain::of([5, 10]));
/// store.restrict(speed, Domain::exactly(10), "in a hurry")?;
/// assert_eq!(store.value(surface), Some(1));
/// # Ok::<(), Refusal<&str>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Rows {
    columns: usize,
    /// One row after another, in rising order, none twice.
    values: Arc<[Value]>,
}

impl Rows {
    /// Rows of as many values as there are columns, one after another, in any order.
    ///
    /// # Panics
    ///
    /// If there are no columns, or if the last row is not complete.
    pub fn new(columns: usize, values: &[Value]) -> Rows {
        assert!(
            columns > 0 && values.len().is_multiple_of(columns),
            "{} values do not make rows of {columns}",
            values.len()
        );
        let mut rows: Vec<&[Value]> = values.chunks_exact(columns).collect();
        rows.sort_unstable();
        rows.dedup();
        Rows {
            columns,
            values: rows.concat().into(),
        }
    }

    /// How many values a row has.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.values.len() / self.columns
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// All rows, rising.
    pub fn rows(&self) -> impl Iterator<Item = &[Value]> {
        self.values.chunks_exact(self.columns)
    }

    fn row(&self, at: usize) -> &[Value] {
        &self.values[at * self.columns..(at + 1) * self.columns]
    }

    /// The rows whose first values lie within a span.
    fn starting_in(&self, span: Span) -> Range<usize> {
        // The first row of which `is_after` is true.
        let find = |is_after: &dyn Fn(Value) -> bool| {
            let (mut from, mut to) = (0, self.len());
            while from < to {
                let middle = from.midpoint(to);
                if is_after(self.values[middle * self.columns]) {
                    to = middle;
                } else {
                    from = middle + 1;
                }
            }
            from
        };
        let from = find(&|value| value >= span.min);
        from..find(&|value| value > span.max).max(from)
    }
}

impl From<&Table> for Rows {
    fn from(table: &Table) -> Rows {
        Rows::new(table.columns, &table.rows)
    }
}

impl<O: Clone> Store<O> {
    /// The operands are a row of a table: each keeps the values that it has in a row that can be.
    pub(super) fn row(&mut self, first: u32, rows: &Rows) -> Result<(), Empty> {
        let near = rows.starting_in(self.span_of(first));
        self.work.rows += near.len() as u64;
        self.scratch.live.clear();
        for at in near {
            let all = (first..).zip(rows.row(at));
            if all
                .into_iter()
                .all(|(link, &value)| self.can_be(link, value))
            {
                self.scratch.live.push(at as u32);
            }
        }
        if self.scratch.live.is_empty() {
            return Err(Empty);
        }
        for (link, column) in (first..).zip(0..rows.columns) {
            let variable = self.links.all[link as usize].variable;
            if variable == NONE {
                continue;
            }
            let node = self.nodes.at(variable as usize);
            let now = &node.expect("the variable is there").domain;
            if now.value().is_some() {
                continue;
            }
            // A variable that is twice in the row may have lost values since.
            let live = self.scratch.live.iter();
            let live = live.map(|&at| rows.row(at as usize)[column]);
            let live = live.filter(|&value| now.contains(value));
            let domain = if let Some(bits) = now.bits() {
                let bit = |value: Value| 1 << value.abs_diff(now.min());
                let found = live.map(bit).fold(0, |all: u64, bit: u64| all | bit);
                (found != bits).then(|| Domain::of_bits(now.min(), found))
            } else {
                self.scratch.values.clear();
                self.scratch.values.extend(live);
                self.scratch.values.sort_unstable();
                self.scratch.values.dedup();
                let all = self.scratch.values.len() as u64 == now.len() && !now.is_interval();
                (!all).then(|| Domain::of_rising(&self.scratch.values))
            };
            if let Some(domain) = domain {
                self.narrow(link, domain)?;
            }
        }
        Ok(())
    }

    /// Whether the operands are certainly a row, or certainly none.
    pub(super) fn is_row(&self, rows: &Rows, operands: &[Operand]) -> Option<bool> {
        let near = rows.starting_in(self.span(operands[0]));
        let fits = |at: &usize| {
            let all = operands.iter().zip(rows.row(*at));
            all.into_iter()
                .all(|(operand, &value)| self.may_be(*operand, value))
        };
        let live = near.filter(fits).count() as u64;
        if live == 0 {
            return Some(false);
        }
        // No row is there twice: if there are as many as combinations, each is one.
        let sizes = operands.iter().map(|operand| self.size(*operand));
        let combinations = sizes.fold(1, u64::saturating_mul);
        (live == combinations).then_some(true)
    }
}
