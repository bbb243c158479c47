//! Sums and products: how the ends of domains follow from each other.
//!
//! All is computed with 128 bits. A sum of fewer than 2^64 values does not overflow them; a product
//! stays at their ends where it would: beyond all values, whatever number it is multiplied by
//! later, but for 0.

use super::Store;
use super::propagate::Empty;
use crate::model::Value;
use crate::temporal::Span;

/// Between which numbers something lies.
type Range = (i128, i128);

impl<O: Clone> Store<O> {
    /// The last operand is the sum of the others.
    pub(super) fn sum(&mut self, first: u32, count: u32) -> Result<(), Empty> {
        let last = first + count - 1;
        let mut total: Range = (0, 0);
        for link in first..last {
            let (min, max) = self.range_of(link);
            total = (total.0 + min, total.1 + max);
        }
        self.narrow_span(last, values(total)?)?;
        let sum = self.range_of(last);
        for link in first..last {
            let (min, max) = self.range_of(link);
            let rest = (total.0 - min, total.1 - max);
            self.narrow_span(link, values((sum.0 - rest.1, sum.1 - rest.0))?)?;
        }
        Ok(())
    }

    /// The last operand is the product of the others.
    pub(super) fn product(&mut self, first: u32, count: u32) -> Result<(), Empty> {
        let last = first + count - 1;
        let mut after: Range = (1, 1);
        self.scratch.products.clear();
        for link in (first..last).rev() {
            self.scratch.products.push(after);
            after = times(after, self.range_of(link));
        }
        self.narrow_span(last, values(after)?)?;
        let product = self.range_of(last);
        let mut before: Range = (1, 1);
        for link in first..last {
            let after = self.scratch.products.pop().expect("one for each input");
            let factor = self.range_of(link);
            if let Some(quotient) = quotient(product, times(before, after)) {
                self.narrow_span(link, values(quotient)?)?;
            }
            if !holds_0(product) {
                let min = if factor.0 == 0 { 1 } else { Value::MIN };
                let max = if factor.1 == 0 { -1 } else { Value::MAX };
                self.narrow_span(link, Span::new(min, max))?;
            }
            before = times(before, factor);
        }
        Ok(())
    }

    fn range_of(&self, link: u32) -> Range {
        let Span { min, max } = self.span_of(link);
        (min.into(), max.into())
    }
}

/// The product of any two numbers of two ranges.
pub(super) fn times(a: Range, b: Range) -> Range {
    let all = [(a.0, b.0), (a.0, b.1), (a.1, b.0), (a.1, b.1)];
    hull(all.map(|(a, b)| a.saturating_mul(b)))
}

fn hull(all: [i128; 4]) -> Range {
    let [a, b, c, d] = all;
    (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)))
}

fn holds_0(range: Range) -> bool {
    range.0 <= 0 && range.1 >= 0
}

/// Between which whole numbers a factor lies whose product with a number of `others` is one of
/// `product`; none if it can be any.
fn quotient(product: Range, mut others: Range) -> Option<Range> {
    if holds_0(others) {
        if holds_0(product) {
            return None;
        }
        // The others are not 0.
        if others.0 == 0 {
            others.0 = 1;
        }
        if others.1 == 0 {
            others.1 = -1;
        }
        if others.0 > others.1 {
            return None;
        }
        if holds_0(others) {
            // From -1 to 1, but for 0: the factor is no larger than the product.
            let most = product.0.abs().max(product.1.abs());
            return Some((-most, most));
        }
    }
    let all = [
        (product.0, others.0),
        (product.0, others.1),
        (product.1, others.0),
        (product.1, others.1),
    ];
    let down = |(a, b): (i128, i128)| a.div_euclid(b) - i128::from(b < 0 && a.rem_euclid(b) != 0);
    let up = |pair: (i128, i128)| -down((-pair.0, pair.1));
    Some((hull(all.map(up)).0, hull(all.map(down)).1))
}

/// The values of a range.
fn values(range: Range) -> Result<Span, Empty> {
    let (min, max) = (
        range.0.max(Value::MIN.into()),
        range.1.min(Value::MAX.into()),
    );
    match (Value::try_from(min), Value::try_from(max)) {
        (Ok(min), Ok(max)) if min <= max => Ok(Span::new(min, max)),
        _ => Err(Empty),
    }
}
