//! The functions that a model may call: pure, of whole numbers, the output last.

use std::collections::BTreeMap;

use crate::model::Value;

/// What a function gives for its inputs; none if it does not know.
pub type Call = fn(&[Value]) -> Option<Value>;

/// The functions that models may name.
///
/// There are always these, each with its output last:
///
/// | function | its output |
/// |---|---|
/// | `min a b`, `max a b` | the lesser, the greater of both |
/// | `abs a` | its size without the sign |
/// | `difference a b` | `a - b` |
/// | `divide a b`, `remainder a b` | the quotient, rounded down, and what is left; unknown if `b` is 0 |
/// | `manhattan x0 y0 x1 y1` | the distance along the axes |
/// | `exceeds a b` | whether `a > b` |
/// | `not a`, `and a b`, `or a b` | of truth values |
///
/// ```
/// use farside_planning::language::Functions;
/// let mut functions = Functions::default();
/// functions.register("halved", 2, |inputs| Some(inputs[0].div_euclid(2)));
/// assert!(functions.names().any(|name| name == "halved"));
/// ```
#[derive(Clone, Debug)]
pub struct Functions {
    list: BTreeMap<String, (usize, Call)>,
}

impl Functions {
    /// Adds a function with `arguments` arguments, the output counted. It must give the same for
    /// the same inputs, whenever it is asked. One of the same name is replaced.
    pub fn register(&mut self, name: &str, arguments: usize, call: Call) {
        self.list.insert(name.to_owned(), (arguments, call));
    }

    /// The names of all, in the order of the alphabet.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.list.keys().map(String::as_str)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, usize, Call)> {
        let list = self.list.iter();
        list.map(|(name, &(arguments, call))| (name.as_str(), arguments, call))
    }
}

impl Default for Functions {
    fn default() -> Self {
        let mut functions = Functions {
            list: BTreeMap::new(),
        };
        functions.register("min", 3, |of| Some(of[0].min(of[1])));
        functions.register("max", 3, |of| Some(of[0].max(of[1])));
        functions.register("abs", 2, |of| of[0].checked_abs());
        functions.register("difference", 3, |of| of[0].checked_sub(of[1]));
        functions.register("divide", 3, |of| {
            let (quotient, rest) = (of[0].checked_div(of[1])?, of[0].checked_rem(of[1])?);
            // Rounded down, whatever the signs.
            quotient.checked_sub(Value::from(rest != 0 && (rest < 0) != (of[1] < 0)))
        });
        functions.register("remainder", 3, |of| {
            let rest = of[0].checked_rem(of[1])?;
            let other = rest != 0 && (rest < 0) != (of[1] < 0);
            rest.checked_add(if other { of[1] } else { 0 })
        });
        functions.register("manhattan", 5, |of| {
            let x = of[2].checked_sub(of[0])?.checked_abs()?;
            let y = of[3].checked_sub(of[1])?.checked_abs()?;
            x.checked_add(y)
        });
        functions.register("exceeds", 3, |of| Some(Value::from(of[0] > of[1])));
        functions.register("not", 2, |of| Some(Value::from(of[0] == 0)));
        functions.register("and", 3, |of| Some(Value::from(of[0] != 0 && of[1] != 0)));
        functions.register("or", 3, |of| Some(Value::from(of[0] != 0 || of[1] != 0)));
        functions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_are_rounded_down_and_unknown_where_there_is_none() {
        let functions = Functions::default();
        let call = |name: &str, inputs: &[Value]| functions.list[name].1(inputs);
        for (a, b) in [(7, 2), (-7, 2), (7, -2), (-7, -2), (6, 3), (-6, 3)] {
            let quotient = call("divide", &[a, b]).expect("there is one");
            let rest = call("remainder", &[a, b]).expect("there is one");
            assert_eq!(quotient * b + rest, a, "{a} / {b}");
            assert!(
                rest.abs() < b.abs() && (rest == 0 || (rest < 0) == (b < 0)),
                "{a} / {b}"
            );
        }
        assert_eq!(call("divide", &[1, 0]), None);
        assert_eq!(call("divide", &[Value::MIN, -1]), None);
        assert_eq!(call("manhattan", &[1, 1, -2, 5]), Some(7));
        assert_eq!(call("abs", &[Value::MIN]), None);
    }
}
