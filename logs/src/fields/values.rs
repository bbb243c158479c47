//! Two values, part by part.
//!
//! Numbers of JSON are compared digit by digit: `1`, `1.0` and `1e0` are one number; `null` is something else
//! than nothing; of keys that are there twice, the first is compared with the first. A time is one value.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::rules::{Bound, Rules};
use super::{FieldDiff, Path, near};
use crate::shown::{SHOWN, apart, shorten};
use crate::value::{Value, write_text};

/// Told of each part in which two values differ by more than they may.
pub(crate) trait Differs {
    /// Two parts at the same place; none where a value has nothing there. Breaks off where no more is
    /// wanted.
    fn differs(
        &mut self,
        path: &Path<'_>,
        a: Option<&Value<'_>>,
        b: Option<&Value<'_>>,
    ) -> ControlFlow<()>;
}

/// The first difference.
#[derive(Default)]
pub(crate) struct First(pub(crate) Option<FieldDiff>);

impl Differs for First {
    fn differs(
        &mut self,
        path: &Path<'_>,
        a: Option<&Value<'_>>,
        b: Option<&Value<'_>>,
    ) -> ControlFlow<()> {
        let path = path.to_string();
        let path = if path.is_empty() {
            "data".to_owned()
        } else {
            path
        };
        self.0 = Some(match (a, b) {
            (Some(Value::Text(x)), Some(Value::Text(y))) => {
                let (a, b) = apart(x, y);
                FieldDiff::new(path, format!("{a:?}"), format!("{b:?}"))
            }
            (Some(Value::Bytes(x)), Some(Value::Bytes(y))) => super::raw(path, x, y),
            (a, b) => {
                let text = |value: Option<&Value<'_>>| value.map_or("absent".to_owned(), show);
                FieldDiff::new(path, text(a), text(b))
            }
        });
        ControlFlow::Break(())
    }
}

/// The first part in which two values differ by more than the rules allow.
pub(crate) fn first(a: &Value<'_>, b: &Value<'_>, rules: &Rules) -> Option<FieldDiff> {
    let mut found = First::default();
    each("", (a, b), rules, &mut found);
    found.0
}

/// All parts in which two values differ by more than the rules allow. `root` is what the values are called.
pub(crate) fn each(
    root: &str,
    (a, b): (&Value<'_>, &Value<'_>),
    rules: &Rules,
    to: &mut impl Differs,
) {
    let Some(bound) = rules.enter_root(root) else {
        return;
    };
    // Only who is told breaks off, and knows.
    let _ = Walk { rules, to }.values(&Path::Root(root), a, b, bound);
}

struct Walk<'r, D> {
    rules: &'r Rules,
    to: &'r mut D,
}

type Entries<'a> = [(Cow<'a, str>, Value<'a>)];

impl<D: Differs> Walk<'_, D> {
    fn values(
        &mut self,
        path: &Path<'_>,
        a: &Value<'_>,
        b: &Value<'_>,
        bound: Bound,
    ) -> ControlFlow<()> {
        if let (Some(x), Some(y)) = (a.as_time_ns(), b.as_time_ns()) {
            return match self.rules.times_agree(x, y, bound) {
                true => ControlFlow::Continue(()),
                false => self.to.differs(path, Some(a), Some(b)),
            };
        }
        match (a, b) {
            (Value::Numbers(x), Value::Numbers(y)) if x == y => ControlFlow::Continue(()),
            (Value::List(_) | Value::Numbers(_), Value::List(_) | Value::Numbers(_)) => {
                self.lists(path, a, b, bound)
            }
            (Value::Object(x), Value::Object(y)) => self.objects(path, x, y, bound),
            _ if same(a, b, bound) => ControlFlow::Continue(()),
            _ => self.to.differs(path, Some(a), Some(b)),
        }
    }

    fn lists(
        &mut self,
        path: &Path<'_>,
        a: &Value<'_>,
        b: &Value<'_>,
        bound: Bound,
    ) -> ControlFlow<()> {
        let lengths = [a, b].map(|list| list.elements().unwrap_or(0));
        for at in 0..lengths[0].min(lengths[1]) {
            let path = Path::Entry(path, &at);
            match (a, b) {
                (Value::List(x), Value::List(y)) => self.values(&path, &x[at], &y[at], bound)?,
                _ => {
                    let (x, y) = (a.element(at), b.element(at));
                    let absent = Value::Null;
                    let (x, y) = (x.as_ref().unwrap_or(&absent), y.as_ref().unwrap_or(&absent));
                    self.values(&path, x, y, bound)?;
                }
            }
        }
        if lengths[0] == lengths[1] {
            return ControlFlow::Continue(());
        }
        let [x, y] = lengths.map(|length| Value::Int(length as i128));
        self.to
            .differs(&Path::Field(path, "length"), Some(&x), Some(&y))
    }

    fn objects(
        &mut self,
        path: &Path<'_>,
        x: &Entries<'_>,
        y: &Entries<'_>,
        bound: Bound,
    ) -> ControlFlow<()> {
        let names = |entries: &Entries<'_>| entries.len();
        // Most are of one type.
        if names(x) == names(y) && x.iter().zip(y).all(|(x, y)| x.0 == y.0) {
            for ((key, x), (_, y)) in x.iter().zip(y) {
                let path = Path::Field(path, key);
                if let Some(bound) = self.rules.enter(&path, bound) {
                    self.values(&path, x, y, bound)?;
                }
            }
            return ControlFlow::Continue(());
        }
        let mut keys: BTreeMap<(&str, usize), [Option<&Value<'_>>; 2]> = BTreeMap::new();
        for (side, entries) in [x, y].into_iter().enumerate() {
            let mut times: BTreeMap<&str, usize> = BTreeMap::new();
            for (key, value) in entries {
                let time = times.entry(key).or_default();
                keys.entry((key, *time)).or_default()[side] = Some(value);
                *time += 1;
            }
        }
        for ((key, _), both) in keys {
            let path = Path::Field(path, key);
            let Some(bound) = self.rules.enter(&path, bound) else {
                continue;
            };
            match both {
                [Some(x), Some(y)] => self.values(&path, x, y, bound)?,
                [x, y] => self.to.differs(&path, x, y)?,
            }
        }
        ControlFlow::Continue(())
    }
}

/// Whether two values without parts are the same, or differ by no more than they may.
fn same(a: &Value<'_>, b: &Value<'_>, bound: Bound) -> bool {
    match (a, b) {
        (Value::Decimal(x), Value::Decimal(y)) => decimals(x, y, bound.number),
        (Value::Float(x), Value::Float(y)) => near(*x, *y, bound.number),
        (Value::Single(x), Value::Single(y)) => near(f64::from(*x), f64::from(*y), bound.number),
        (Value::Int(x), Value::Int(y)) => {
            x == y || bound.own && near(*x as f64, *y as f64, bound.number)
        }
        (
            Value::Enum { number, name },
            Value::Enum {
                number: other,
                name: called,
            },
        ) => number == other && name == called,
        (Value::Decimal(_) | Value::Float(_) | Value::Single(_) | Value::Int(_), _) => {
            let is_number = !matches!(b, Value::Bool(_) | Value::Enum { .. });
            match (a.as_f64(), b.as_f64()) {
                (Some(x), Some(y)) if is_number => near(x, y, bound.number),
                _ => false,
            }
        }
        (a, b) => a == b,
    }
}

/// True if two numbers of JSON are the same or differ by no more than the tolerance.
fn decimals(a: &str, b: &str, tolerance: f64) -> bool {
    if a == b {
        return true;
    }
    if let (Some(x), Some(y)) = (decimal(a), decimal(b))
        && x == y
    {
        return true;
    }
    let read = |text: &str| text.parse::<f64>().ok().filter(|number| number.is_finite());
    match (read(a), read(b)) {
        // Without a tolerance, digits decide: there are more of them than a float holds.
        (Some(x), Some(y)) if tolerance > 0.0 => near(x, y, tolerance),
        _ => false,
    }
}

/// A number's sign, its digits without zeros around them, and the power of ten of the last one.
fn decimal(text: &str) -> Option<(bool, String, i64)> {
    let (negative, text) = match text.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, text),
    };
    let (digits, exponent) = match text.split_once(['e', 'E']) {
        Some((digits, exponent)) => (digits, exponent.parse::<i64>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let all = format!("{whole}{part}");
    let all = all.trim_start_matches('0');
    let kept = all.trim_end_matches('0');
    if kept.is_empty() {
        return Some((negative, String::new(), 0));
    }
    let dropped = (all.len() - kept.len()) as i64;
    let exponent = exponent.checked_add(dropped)?;
    Some((
        negative,
        kept.to_owned(),
        exponent.checked_sub(part.len() as i64)?,
    ))
}

/// A value as people are shown it: as JSON, times in seconds, until there is enough.
pub(crate) fn show(value: &Value<'_>) -> String {
    if let Some(ns) = value.as_time_ns() {
        let (sign, ns) = (if ns < 0 { "-" } else { "" }, ns.unsigned_abs());
        return format!("{sign}{}.{:09} s", ns / 1_000_000_000, ns % 1_000_000_000);
    }
    let mut out = String::new();
    write(value, &mut out);
    shorten(&out)
}

/// Appends a value, until there is enough to be shown.
fn write(value: &Value<'_>, out: &mut String) {
    match value {
        Value::Text(text) => out.push_str(&format!("{:?}", shorten(text))),
        Value::Bytes(bytes) => out.push_str(&format!("{} bytes", bytes.len())),
        Value::List(_) | Value::Numbers(_) => {
            out.push('[');
            let count = value.elements().unwrap_or(0).min(SHOWN);
            for at in 0..count {
                if out.len() > SHOWN {
                    break;
                }
                out.push_str(if at == 0 { "" } else { "," });
                match value {
                    Value::List(values) => write(&values[at], out),
                    list => list.element(at).iter().for_each(|value| write(value, out)),
                }
            }
            out.push(']');
        }
        Value::Object(entries) => {
            out.push('{');
            for (at, (key, value)) in entries.iter().enumerate() {
                if out.len() > SHOWN {
                    break;
                }
                out.push_str(if at == 0 { "" } else { "," });
                // Writing to a text cannot fail.
                let _ = write_text(&shorten(key), out);
                out.push(':');
                write(value, out);
            }
            out.push('}');
        }
        plain => out.push_str(&plain.to_string()),
    }
}
