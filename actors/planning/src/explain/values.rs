//! Values that cannot all be, in words.

use std::collections::BTreeMap;

use super::teller::{Teller, reason};
use super::{Part, Reason, ReasonKind};
use crate::database::Owner;
use crate::model::{NUMBER, TypeId};
use crate::parameters::{Domain, Kind, Operand, Refusal, Variable};

/// How many operations each try takes to leave out a part of a conflict of values.
const OPERATIONS: u64 = 20_000;

/// How many values of a domain are listed.
const MOST_VALUES: usize = 8;

/// By variable: what it is, and its type.
type Names = BTreeMap<Variable, (String, TypeId)>;

impl Teller<'_> {
    pub(super) fn values(&self, refusal: &Refusal<Owner>) -> Reason {
        let conflict = match refusal {
            Refusal::OverBudget { .. } => {
                return reason(ReasonKind::Undecided, refusal.to_string(), Vec::new());
            }
            Refusal::Conflict(conflict) => conflict.minimal(OPERATIONS),
        };
        let names = self.names();
        let parts = conflict.parts.iter().map(|part| {
            let because = self.because(part.owner);
            let sentence = self.sentence(&names, &part.kind, &part.operands);
            Part {
                message: format!("{sentence}: {}", because.phrase),
                place: because.place,
                amount: None,
                tokens: because.tokens,
            }
        });
        let message = match conflict.is_minimal {
            true => "these values cannot all be",
            false => "these values cannot all be, or fewer of them",
        };
        reason(ReasonKind::Values, message.to_owned(), parts.collect())
    }

    /// What variables are: parameters of tokens first, then variables of their rules.
    fn names(&self) -> Names {
        let (database, model) = (self.database, self.database.model());
        let mut names = Names::new();
        for (token, at) in database.tokens() {
            let parameters = &model.predicates[at.predicate].parameters;
            for (place, (parameter, operand)) in parameters.iter().zip(&at.parameters).enumerate() {
                if let Operand::Variable(variable) = *operand {
                    names.entry(variable).or_insert_with(|| {
                        let name = crate::plan::argument_name(&parameter.name, place);
                        (format!("{name} of {}", self.name(token)), parameter.of)
                    });
                }
            }
        }
        for (token, at) in database.tokens() {
            for instance in at
                .instances()
                .iter()
                .filter_map(|&at| database.instance(at))
            {
                let variables = &model.rules[instance.rule].variables;
                for (place, variable) in variables.iter().enumerate() {
                    if let Some(Operand::Variable(of)) = instance.variable(place) {
                        names.entry(of).or_insert_with(|| {
                            let name = format!("{} of {}", variable.name, self.name(token));
                            (name, variable.of)
                        });
                    }
                }
            }
        }
        names
    }

    fn sentence(&self, names: &Names, kind: &Kind, operands: &[Operand]) -> String {
        let model = self.database.model();
        // Values are written as the type of a variable beside them says.
        let of = operands.iter().find_map(|operand| match operand {
            Operand::Variable(variable) => names.get(variable).map(|at| at.1),
            Operand::Value(_) => None,
        });
        let of = of.unwrap_or(NUMBER);
        let shown: Vec<String> = operands
            .iter()
            .map(|operand| match operand {
                Operand::Value(value) => model.show(of, *value),
                Operand::Variable(variable) => match names.get(variable) {
                    Some((name, _)) => name.clone(),
                    None => "a value in between".to_owned(),
                },
            })
            .collect();
        let (last, others) = match shown.split_last() {
            Some((last, others)) => (last.as_str(), others),
            None => ("", &[][..]),
        };
        match kind {
            Kind::In(domain) => format!("{last} is {}", self.domain(of, domain)),
            Kind::Equal => shown.join(" equals "),
            Kind::Different => shown.join(" differs from "),
            Kind::Less => shown.join(" is less than "),
            Kind::AtMost => shown.join(" is at most "),
            Kind::Sum => format!("{last} is the sum of {}", others.join(" and ")),
            Kind::Product => format!("{last} is the product of {}", others.join(" and ")),
            Kind::Table(_) => format!("({}) is a row of a table", shown.join(", ")),
            Kind::Function(_) => format!("{last} is a function of {}", others.join(" and ")),
        }
    }

    fn domain(&self, of: TypeId, domain: &Domain) -> String {
        let model = self.database.model();
        let (min, max) = (domain.min(), domain.max());
        if domain.is_empty() {
            return "nothing".to_owned();
        }
        let show = |value| model.show(of, value);
        if domain.value().is_some() {
            return show(min);
        }
        let numbers = matches!(model.types[of].values, crate::model::Values::Numbers(_));
        let whole = domain.len() as i128 == i128::from(max) - i128::from(min) + 1;
        if numbers && whole {
            return match (min, max) {
                (_, i64::MAX) => format!("{min} or more"),
                (i64::MIN, _) => format!("{max} or less"),
                _ => format!("{min} to {max}"),
            };
        }
        let listed: Vec<String> = domain.values().take(MOST_VALUES).map(show).collect();
        let more = if domain.len() > MOST_VALUES as u64 {
            ", …"
        } else {
            ""
        };
        format!("one of {}{more}", listed.join(", "))
    }
}
