//! What a word stands for: a number, a truth value, a symbol, infinity.

use std::collections::BTreeMap;

use super::Scope;
use crate::language::findings::Notes;
use crate::language::tree::{Form, Kind};
use crate::model::{Model, TypeId, Value, Values};
use crate::temporal::{FURTHEST, Span};

/// What sort of value a literal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sort {
    Truth,
    Number,
    Symbol,
}

impl Sort {
    pub(super) fn of(model: &Model, of: TypeId) -> Sort {
        match &model.types[of].values {
            Values::Truth => Sort::Truth,
            Values::Numbers(_) => Sort::Number,
            Values::Symbols(_) => Sort::Symbol,
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Sort::Truth => "a truth value",
            Sort::Number => "a number",
            Sort::Symbol => "a symbol",
        }
    }
}

/// Whether a word is written as the names of constants are.
pub(super) fn is_constant(word: &str) -> bool {
    word.len() > 2 && word.starts_with('*') && word.ends_with('*')
}

/// A literal, or the one that a constant stands for.
pub(super) fn resolve<'t>(form: Form<'t>, constants: &BTreeMap<&'t str, Form<'t>>) -> Form<'t> {
    constants.get(form.word()).copied().unwrap_or(form)
}

/// The value of a word that is a number or a truth value.
pub(super) fn plain(form: Form) -> Option<(Value, Sort)> {
    match (form.kind(), form.word()) {
        (Kind::Number, word) => {
            let value: Value = word.parse().ok()?;
            (-FURTHEST..=FURTHEST)
                .contains(&value)
                .then_some((value, Sort::Number))
        }
        (Kind::Symbol, "True") => Some((1, Sort::Truth)),
        (Kind::Symbol, "False") => Some((0, Sort::Truth)),
        _ => None,
    }
}

/// Which end of bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Least,
    Greatest,
}

/// A number as an end of bounds, rounded inwards to a whole one; or no bound where `inf` stands:
/// `Err` if it is neither.
pub(super) fn bound<'t>(
    form: Form<'t>,
    side: Side,
    constants: &BTreeMap<&'t str, Form<'t>>,
) -> Result<Option<Value>, ()> {
    let literal = resolve(form, constants);
    match (literal.kind(), literal.word()) {
        (_, "inf" | "+inf" | "-inf") => Ok(None),
        (Kind::Decimal, word) => {
            let value: f64 = word.parse().map_err(drop)?;
            let whole = match side {
                Side::Least => value.ceil(),
                Side::Greatest => value.floor(),
            };
            // Beyond 2^53, a fraction is not told from a whole number.
            if whole.abs() <= (1_i64 << 53) as f64 {
                Ok(Some(whole as Value))
            } else {
                Err(())
            }
        }
        _ => whole(form, constants).map(Some).ok_or(()),
    }
}

/// A whole number.
pub(super) fn whole<'t>(form: Form<'t>, constants: &BTreeMap<&'t str, Form<'t>>) -> Option<Value> {
    match plain(resolve(form, constants)) {
        Some((value, Sort::Number)) => Some(value),
        _ => None,
    }
}

/// What a number must be, in words.
pub(super) const A_NUMBER: &str = "a whole number, at most 2^56";

/// The two ends of bounds; of a number, itself twice.
pub(super) fn ends<'t>(form: Form<'t>, notes: &mut Notes) -> Option<[Form<'t>; 2]> {
    if form.kind() != Kind::Span {
        if !form.word().is_empty() {
            return Some([form, form]);
        }
        notes.error(form, "bounds, as [0 10]");
        return None;
    }
    let mut ends = form.children();
    match (ends.next(), ends.next(), ends.next()) {
        (Some(min), Some(max), None) => Some([min, max]),
        _ => {
            notes.error(form, "two bounds, as [0 10]");
            None
        }
    }
}

/// A span of whole numbers, as `[0 10]`, `[-inf 5]` or `7`.
pub(super) fn span<'t>(
    form: Form<'t>,
    constants: &BTreeMap<&'t str, Form<'t>>,
    notes: &mut Notes,
) -> Option<Span> {
    let [min, max] = ends(form, notes)?;
    let side = |form: Form<'t>, side: Side, notes: &mut Notes| {
        let (wrong, usual) = match side {
            Side::Least => ("inf", Value::MIN),
            Side::Greatest => ("-inf", Value::MAX),
        };
        let value = bound(form, side, constants);
        if value.is_err() || resolve(form, constants).word() == wrong {
            notes.error(form, A_NUMBER);
            return None;
        }
        value.ok().map(|value| value.unwrap_or(usual))
    };
    let low = side(min, Side::Least, notes);
    let high = side(max, Side::Greatest, notes);
    let span = Span::new(low?, high?);
    if span.is_empty() {
        notes.error(form, "bounds of which the first is at most the second");
        return None;
    }
    Some(span)
}

/// Whether a value of some sort is one of a type.
pub(super) fn fits(model: &Model, of: TypeId, value: Value, sort: Sort) -> bool {
    match &model.types[of].values {
        Values::Truth => sort == Sort::Truth,
        Values::Numbers(span) => sort == Sort::Number && span.contains(value),
        Values::Symbols(symbols) => sort == Sort::Symbol && symbols.binary_search(&value).is_ok(),
    }
}

/// What the values of a type are, in words.
pub(super) fn describe(model: &Model, of: TypeId) -> String {
    match &model.types[of].values {
        Values::Truth => "True or False".to_owned(),
        Values::Numbers(span) if *span == Span::ALL => A_NUMBER.to_owned(),
        Values::Numbers(span) => format!("a number of {} {span:?}", model.types[of].name),
        Values::Symbols(_) => format!("a symbol of {}", model.types[of].name),
    }
}

impl<'t> Scope<'t, '_> {
    /// The value of a literal, of whatever sort; nothing is noted if it has none.
    pub(super) fn value(&self, form: Form<'t>) -> Option<(Value, Sort)> {
        let literal = resolve(form, self.constants);
        plain(literal).or_else(|| {
            let symbol = self.names.symbols.get(literal.symbol()?)?;
            Some((*symbol, Sort::Symbol))
        })
    }

    /// The value of a literal of a type.
    pub(super) fn value_of(&mut self, form: Form<'t>, of: TypeId) -> Option<Value> {
        match self.value(form) {
            Some((value, sort)) if fits(self.model, of, value, sort) => Some(value),
            _ => {
                self.not_of(form, of);
                None
            }
        }
    }

    /// Notes that something is no value of a type.
    pub(super) fn not_of(&mut self, form: Form, of: TypeId) {
        let expected = describe(self.model, of);
        let Values::Symbols(symbols) = &self.model.types[of].values else {
            self.notes.error(form, expected);
            return;
        };
        let known = symbols
            .iter()
            .map(|&symbol| self.model.symbols[symbol as usize].as_str());
        self.notes.unknown(form, expected, known);
    }

    /// A whole number.
    pub(super) fn number(&mut self, form: Form<'t>) -> Option<Value> {
        match self.value(form) {
            Some((value, Sort::Number)) => Some(value),
            _ => {
                self.notes.error(form, A_NUMBER);
                None
            }
        }
    }
}
