//! One procedure's entry, checked against the model: which names, types and units it may have.

use farside_actors::rover::{Part, View};
use farside_planning::model::{Model, Parameter, PredicateId, Values};
use toml::Value;

use super::super::action::{Action, Name, Number, Output, Truth};
use super::super::words::{COMMANDS, Needs, Quantity, READINGS, UNITS, Unit, VIEWS, Verb};
use super::{Ends, Entry, EntryText, RelayProblem};
use crate::register::RegisterValue;

/// A key of an entry, and what is wrong with it.
type Wrong = (String, RelayProblem);

/// Reads an entry.
pub(super) fn read(
    text: &EntryText,
    model: &Model,
    predicate: PredicateId,
    ends: &Ends,
) -> Result<Entry, Wrong> {
    let procedure = &model.predicates[predicate];
    let (inputs, outputs) = procedure.parameters.split_at(procedure.inputs);
    let of = Of {
        model,
        inputs,
        outputs,
    };
    let others = |key: &str| {
        let problem = RelayProblem::expected("one of idle, command and outputs", "more of them");
        Err((key.to_owned(), problem))
    };
    match (&text.command, text.idle, text.outputs.is_empty()) {
        (Some(_), true, _) => others("idle"),
        (Some(_), _, false) | (None, true, false) => others("outputs"),
        (None, _, _) if !text.with.is_empty() => {
            let problem = RelayProblem::expected("a command that takes them", "none");
            Err(("with".to_owned(), problem))
        }
        (Some(name), false, true) => of.command(name, text, ends),
        (None, _, _) if text.status.is_some() => {
            let problem = RelayProblem::expected("a command whose end it says", "none");
            Err(("status".to_owned(), problem))
        }
        (None, true, true) => Ok(Entry::Idle),
        (None, false, false) => of.poll(&text.outputs),
        (None, false, true) => {
            let problem = RelayProblem::expected("one of idle, command and outputs", "none");
            Err((String::new(), problem))
        }
    }
}

/// A procedure and its model.
struct Of<'a> {
    model: &'a Model,
    inputs: &'a [Parameter],
    outputs: &'a [Parameter],
}

/// Where the value of an argument comes from.
enum Source<'a> {
    /// It is in the table.
    Fixed(&'a Value),
    /// It is the input at a place.
    Input(usize),
}

/// A parameter's name as tables have it.
fn plain(name: &str) -> &str {
    name.strip_prefix('?').unwrap_or(name)
}

fn place(name: &str, of: &[Parameter], what: &'static str) -> Result<usize, RelayProblem> {
    let names = || of.iter().map(|one| plain(&one.name));
    let found = names().position(|one| !one.is_empty() && one == plain(name));
    found.ok_or_else(|| RelayProblem::unknown(what, name, names()))
}

fn unit(name: &str, quantity: Quantity) -> Result<Unit, RelayProblem> {
    let fitting = || UNITS.iter().filter(|unit| unit.of == quantity);
    let found = fitting().find(|unit| unit.name == name);
    found.copied().ok_or_else(|| {
        let names: Vec<&str> = fitting().map(|unit| unit.name).collect();
        RelayProblem::expected(format!("one of the units {}", names.join(", ")), name)
    })
}

/// A text in a table.
fn text<'a>(value: &'a Value, what: &str) -> Result<&'a str, RelayProblem> {
    let expected = || RelayProblem::expected(what, value.to_string());
    value.as_str().ok_or_else(expected)
}

/// A number in a table.
fn number(value: &Value) -> Result<f64, RelayProblem> {
    let number = match value {
        Value::Integer(number) => *number as f64,
        Value::Float(number) if number.is_finite() => *number,
        other => return Err(RelayProblem::expected("a number", other.to_string())),
    };
    Ok(number)
}

impl Of<'_> {
    fn command(&self, name: &str, entry: &EntryText, ends: &Ends) -> Result<Entry, Wrong> {
        let known = || COMMANDS.iter().map(|(name, ..)| *name);
        let Some((_, verb, needs)) = COMMANDS.iter().find(|(one, ..)| *one == name) else {
            let problem = RelayProblem::unknown("command", name, known());
            return Err(("command".to_owned(), problem));
        };
        for key in entry.with.keys() {
            if !needs.iter().any(|(name, _)| name == key) {
                let names = needs.iter().map(|(name, _)| *name);
                let problem = RelayProblem::unknown("argument of the command", key, names);
                return Err((format!("with.{key}"), problem));
            }
        }
        let mut arguments = Arguments {
            of: self,
            used: vec![false; self.inputs.len()],
            entry,
        };
        let action = arguments.action(*verb, needs)?;
        let used = arguments.used.iter().filter(|used| **used).count();
        if used < self.inputs.len() {
            let (what, expected, actual) = ("inputs", self.inputs.len(), used);
            let problem = RelayProblem::Count {
                what,
                expected,
                actual,
            };
            return Err(("with".to_owned(), problem));
        }
        let status = self
            .status(entry.status.as_deref(), ends)
            .map_err(|problem| ("status".to_owned(), problem))?;
        Ok(Entry::Command {
            action,
            status,
            outputs: self.outputs.len(),
        })
    }

    /// The place of the output that says how a command ended; none if there are no outputs.
    fn status(&self, name: Option<&str>, ends: &Ends) -> Result<Option<usize>, RelayProblem> {
        let place = match (name, self.outputs) {
            (None, []) => return Ok(None),
            (Some(name), outputs) => place(name, outputs, "output of the procedure")?,
            (None, [_]) => 0,
            (None, outputs) => {
                let (what, expected, actual) = ("outputs", outputs.len(), 1);
                return Err(RelayProblem::Count {
                    what,
                    expected,
                    actual,
                });
            }
        };
        for symbol in [&ends.done, &ends.failed, &ends.stopped, &ends.refused] {
            self.symbol(&self.outputs[place], symbol)?;
        }
        Ok(Some(place))
    }

    /// Checks that a parameter can be a symbol.
    fn symbol(&self, parameter: &Parameter, symbol: &str) -> Result<(), RelayProblem> {
        let Values::Symbols(symbols) = self.values(parameter) else {
            return Err(self.not_of_type(parameter, &format!("the symbol {symbol}")));
        };
        let names = || {
            let at = symbols.iter().filter_map(|&one| usize::try_from(one).ok());
            at.filter_map(|at| self.model.symbols.get(at))
        };
        match names().any(|one| one == symbol) {
            true => Ok(()),
            false => {
                let names = names().map(String::as_str);
                Err(RelayProblem::unknown("symbol of its type", symbol, names))
            }
        }
    }

    fn values(&self, parameter: &Parameter) -> &Values {
        &self.model.types[parameter.of].values
    }

    fn not_of_type(&self, parameter: &Parameter, actual: &str) -> RelayProblem {
        let of = &self.model.types[parameter.of].name;
        let expected = format!("a value of the type {of}, which {} has", parameter.name);
        RelayProblem::expected(expected, actual)
    }

    fn poll(&self, outputs: &toml::Table) -> Result<Entry, Wrong> {
        let mut places = vec![None; self.outputs.len()];
        for (name, value) in outputs {
            let at = |problem| (format!("outputs.{name}"), problem);
            let place = place(name, self.outputs, "output of the procedure").map_err(at)?;
            let output = self.output(&self.outputs[place], value).map_err(at)?;
            places[place] = Some(output);
        }
        Ok(Entry::Poll(places))
    }

    fn output(&self, parameter: &Parameter, value: &Value) -> Result<Output, RelayProblem> {
        let Value::Table(table) = value else {
            return self.fixed(parameter, value);
        };
        for key in table.keys() {
            if !["reading", "unit"].contains(&key.as_str()) {
                let names = ["reading", "unit"].into_iter();
                return Err(RelayProblem::unknown("key of an output", key, names));
            }
        }
        let missing = || RelayProblem::expected("a reading", "none");
        let name = text(
            table.get("reading").ok_or_else(missing)?,
            "a reading's name",
        )?;
        let Some((_, reading, quantity)) = READINGS.iter().find(|(one, ..)| *one == name) else {
            let names = READINGS.iter().map(|(name, ..)| *name);
            return Err(RelayProblem::unknown("reading", name, names));
        };
        match (self.values(parameter), quantity) {
            (Values::Numbers(span), Some(quantity)) => {
                let unit = given_unit(table.get("unit"), *quantity)?;
                Ok(Output::Number(*reading, unit, [span.min, span.max]))
            }
            (Values::Truth, None) if table.get("unit").is_none() => Ok(Output::Truth(*reading)),
            (Values::Truth, None) => Err(RelayProblem::expected("no unit", "one")),
            _ => Err(self.not_of_type(parameter, &format!("the reading {name}"))),
        }
    }

    fn fixed(&self, parameter: &Parameter, value: &Value) -> Result<Output, RelayProblem> {
        let fixed = match (self.values(parameter), value) {
            (Values::Truth, Value::Boolean(truth)) => RegisterValue::Truth(*truth),
            (Values::Numbers(span), Value::Integer(number))
                if (span.min..=span.max).contains(number) =>
            {
                RegisterValue::Number(*number)
            }
            (Values::Symbols(_), Value::String(symbol)) => {
                self.symbol(parameter, symbol)?;
                RegisterValue::Symbol(symbol.as_str().into())
            }
            _ => return Err(self.not_of_type(parameter, &value.to_string())),
        };
        Ok(Output::Fixed(fixed))
    }
}

/// The unit that an entry gives for a quantity.
fn given_unit(name: Option<&Value>, quantity: Quantity) -> Result<Unit, RelayProblem> {
    match name {
        Some(name) => unit(text(name, "a unit's name")?, quantity),
        None => unit("none", quantity),
    }
}

/// The arguments of a command, as they are used.
struct Arguments<'a> {
    of: &'a Of<'a>,
    /// By input: whether the command has it.
    used: Vec<bool>,
    entry: &'a EntryText,
}

impl<'a> Arguments<'a> {
    fn action(&mut self, verb: Verb, needs: &[(&str, Needs)]) -> Result<Action, Wrong> {
        let mut numbers = Vec::new();
        let mut names = Vec::new();
        let (mut truth, mut view, mut part) = (Truth::Fixed(false), View::Point, None);
        for (key, needs) in needs {
            let at = |problem| (format!("with.{key}"), problem);
            let Some(value) = self.entry.with.get(*key) else {
                if needs.is_optional() {
                    continue;
                }
                return Err(at(RelayProblem::expected("a value", "none")));
            };
            match needs {
                Needs::Number(quantity) => {
                    numbers.push(self.number(value, *quantity).map_err(at)?);
                }
                Needs::Name => names.push(self.name(value).map_err(at)?),
                Needs::Truth => truth = self.truth(value).map_err(at)?,
                Needs::View => view = named_view(value).map_err(at)?,
                Needs::Part => part = Some(named_part(value).map_err(at)?),
            }
        }
        let mut numbers = numbers.into_iter();
        let mut number = || numbers.next().expect("numbers that the command needs");
        let mut names = names.into_iter();
        let mut name = || names.next().expect("a name that the command needs");
        Ok(match verb {
            Verb::Drive => Action::Drive([number(), number()]),
            Verb::Turn => Action::Turn(number()),
            Verb::TurnBy => Action::TurnBy(number()),
            Verb::BackUp => Action::BackUp(number()),
            Verb::Stop => Action::Stop(part),
            Verb::Point => Action::Point([number(), number()]),
            Verb::PointAt => Action::PointAt([number(), number()]),
            Verb::Image => Action::Image(name(), view),
            Verb::Spectrum => Action::Spectrum(name(), view),
            Verb::Transmit => Action::Transmit(name(), number()),
            Verb::Heat => Action::Heat(number()),
            Verb::Sleep => Action::Sleep(number()),
            Verb::Fans => Action::Fans(truth),
        })
    }

    /// Where a value comes from, and its unit, if it gives one.
    fn source(
        &mut self,
        value: &'a Value,
    ) -> Result<(Source<'a>, Option<&'a Value>), RelayProblem> {
        let Value::Table(table) = value else {
            return Ok((Source::Fixed(value), None));
        };
        for key in table.keys() {
            let keys = ["input", "value", "unit"];
            if !keys.contains(&key.as_str()) {
                let problem = RelayProblem::unknown("key of an argument", key, keys.into_iter());
                return Err(problem);
            }
        }
        let unit = table.get("unit");
        match (table.get("input"), table.get("value")) {
            (Some(name), None) => {
                let name = text(name, "the name of an input")?;
                let place = place(name, self.of.inputs, "input of the procedure")?;
                self.used[place] = true;
                Ok((Source::Input(place), unit))
            }
            (None, Some(value)) => Ok((Source::Fixed(value), unit)),
            _ => Err(RelayProblem::expected(
                "either input or value",
                value.to_string(),
            )),
        }
    }

    fn number(&mut self, value: &'a Value, quantity: Quantity) -> Result<Number, RelayProblem> {
        let (source, unit) = self.source(value)?;
        let unit = given_unit(unit, quantity)?;
        match source {
            Source::Fixed(value) => Ok(Number::Fixed(unit.to_hardware(number(value)?))),
            Source::Input(place) => {
                let parameter = &self.of.inputs[place];
                match self.of.values(parameter) {
                    Values::Numbers(_) => Ok(Number::Input(place, unit)),
                    _ => Err(self.of.not_of_type(parameter, "a number")),
                }
            }
        }
    }

    fn name(&mut self, value: &'a Value) -> Result<Name, RelayProblem> {
        match self.source(value)?.0 {
            Source::Fixed(value) => Ok(Name::Fixed(text(value, "a name")?.into())),
            Source::Input(place) => {
                let parameter = &self.of.inputs[place];
                match self.of.values(parameter) {
                    Values::Symbols(_) => Ok(Name::Input(place)),
                    _ => Err(self.of.not_of_type(parameter, "a name")),
                }
            }
        }
    }

    fn truth(&mut self, value: &'a Value) -> Result<Truth, RelayProblem> {
        match self.source(value)?.0 {
            Source::Fixed(Value::Boolean(truth)) => Ok(Truth::Fixed(*truth)),
            Source::Fixed(other) => Err(RelayProblem::expected("true or false", other.to_string())),
            Source::Input(place) => {
                let parameter = &self.of.inputs[place];
                match self.of.values(parameter) {
                    Values::Truth => Ok(Truth::Input(place)),
                    _ => Err(self.of.not_of_type(parameter, "true or false")),
                }
            }
        }
    }
}

fn named_view(value: &Value) -> Result<View, RelayProblem> {
    let name = text(value, "a view's name")?;
    let found = VIEWS.iter().find(|(one, _)| *one == name);
    let unknown = || RelayProblem::unknown("view", name, VIEWS.iter().map(|(one, _)| *one));
    found.map(|(_, view)| *view).ok_or_else(unknown)
}

/// A part by its name: an instrument's, if it is none of those that every rover has.
fn named_part(value: &Value) -> Result<Part, RelayProblem> {
    Ok(match text(value, "a part's name")? {
        "wheels" => Part::Wheels,
        "mast" => Part::Mast,
        "radio" => Part::Radio,
        "heater" => Part::Heater,
        "body" => Part::Body,
        "fans" => Part::Fans,
        name => Part::Instrument {
            name: name.to_owned(),
        },
    })
}
