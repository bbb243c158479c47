//! Numbers in messages over time: what the page plots.

use std::collections::BTreeMap;

use farside_logs::{Value, escaped};
use serde_json::{Value as Json, json};

use crate::thinned::Thinned;

/// As many points as are kept of a curve after thinning, and four times as many before.
const POINTS: usize = 128;

/// As many curves as a page holds.
const CURVES: usize = 1_200;

/// Parts of times, which say nothing by themselves.
const TIMES: [&str; 6] = ["sec", "nanosec", "secs", "nsecs", "seconds", "nanos"];

/// The curves of a log: by kind of message and field, and by actor.
#[derive(Debug, Default)]
pub(super) struct Series {
    curves: BTreeMap<(String, String), BTreeMap<String, Thinned>>,
    count: usize,
    /// Values for whose curves there was no room.
    left_out: u64,
}

impl Series {
    /// Adds all numbers of a message that an actor recorded, or that came on a topic.
    pub(super) fn add(&mut self, kind: &str, actor: &str, value: &Value<'_>, at_ns: u64) {
        let Series {
            curves,
            count,
            left_out,
        } = self;
        value.flatten(&mut |path, value| {
            let number = match value {
                Value::Int(_)
                | Value::Float(_)
                | Value::Single(_)
                | Value::Decimal(_)
                | Value::Bool(_) => value.as_f64(),
                _ => None,
            };
            let last = path.rsplit('.').next().unwrap_or(path);
            let Some(number) = number.filter(|_| !TIMES.contains(&last)) else {
                return;
            };
            let by_actor = curves.entry((kind.to_owned(), path.to_owned()));
            let by_actor = by_actor.or_default();
            if let Some(curve) = by_actor.get_mut(actor) {
                curve.push(at_ns, number);
            } else if *count < CURVES {
                *count += 1;
                let mut curve = Thinned::to(POINTS);
                curve.push(at_ns, number);
                by_actor.insert(actor.to_owned(), curve);
            } else {
                *left_out += 1;
            }
        });
    }

    /// The fields that are not one value all the time, each with its curves: times in microseconds, each since the
    /// one before, and values.
    pub(super) fn told(&self) -> Json {
        let mut constant = 0_usize;
        let mut fields = Vec::new();
        for ((kind, field), by_actor) in &self.curves {
            let ranges = by_actor.values().filter_map(|curve| curve.range);
            let [least, greatest] = ranges
                .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
                .unwrap_or([0.0; 2]);
            if least >= greatest {
                constant += 1;
                continue;
            }
            let curves: Vec<Json> = by_actor
                .iter()
                .map(|(actor, curve)| {
                    let mut before = 0;
                    let points = curve.evenly();
                    let (times, values): (Vec<u64>, Vec<Json>) = points
                        .iter()
                        .map(|(time_ns, value)| {
                            let time = time_ns / 1_000;
                            let since = time.saturating_sub(before);
                            before = before.max(time);
                            (since, rounded(*value))
                        })
                        .unzip();
                    json!({ "actor": escaped(actor), "values": curve.values, "t": times, "v": values })
                })
                .collect();
            fields.push(json!({
                "kind": escaped(kind), "field": escaped(field),
                "least": rounded(least), "greatest": rounded(greatest), "curves": curves,
            }));
        }
        json!({ "fields": fields, "constant": constant, "left_out": self.left_out })
    }
}

/// A number with as many digits as a screen can show; null for what is none.
fn rounded(value: f64) -> Json {
    let short = value as f32;
    match short.is_finite() {
        // Through its shortest text: as 64 bits it would have digits that nobody wrote.
        true => format!("{short}")
            .parse::<f64>()
            .map_or(Json::Null, Json::from),
        false if value.is_finite() => Json::from(value),
        false => Json::Null,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(charge: f64, mode: i128) -> Value<'static> {
        Value::Object(vec![
            ("charge".into(), Value::Float(charge)),
            ("mode".into(), Value::Int(mode)),
            ("name".into(), Value::from("x")),
            (
                "stamp".into(),
                Value::Object(vec![("sec".into(), Value::Int(mode + charge as i128))]),
            ),
        ])
    }

    #[test]
    fn what_varies_is_a_curve_and_times_are_told_as_differences() {
        let mut series = Series::default();
        for (at, charge) in [(1_000, 0.1), (3_000, 0.5), (9_000, f64::NAN)] {
            series.add("battery", "rover_1", &sample(charge, 7), at);
        }
        let told = series.told();
        let fields = told["fields"].as_array().unwrap();
        assert_eq!(fields.len(), 1, "{told}");
        let curve = &fields[0]["curves"][0];
        assert_eq!(curve["t"], json!([1, 2, 6]));
        assert_eq!(curve["v"], json!([0.1, 0.5, null]));
        assert_eq!(told["constant"], 1);
    }

    #[test]
    fn there_is_a_bound_to_curves_and_what_is_behind_it_is_counted() {
        let mut series = Series::default();
        for actor in 0..CURVES + 5 {
            let value = Value::Object(vec![("x".into(), Value::Int(actor as i128))]);
            series.add("k", &actor.to_string(), &value, 0);
        }
        assert_eq!(series.told()["left_out"], 5);
    }
}
