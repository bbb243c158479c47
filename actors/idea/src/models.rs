//! The K9's models: their texts, read once, with the places of what they declare.

use std::sync::{Arc, OnceLock};

use farside_planning::language::{Options, format, read_model};
use farside_planning::model::Model;

/// The text of the system agent's model.
pub const SYSTEM_TEXT: &str = include_str!("../models/k9-system.ddl");

/// The text of its relay's table: see [`RelayTable`](crate::relay::RelayTable).
pub const RELAY_TEXT: &str = include_str!("../models/k9-relay.toml");

/// The system agent's model.
pub fn system() -> Arc<Model> {
    static MODEL: OnceLock<Arc<Model>> = OnceLock::new();
    MODEL
        .get_or_init(|| read("k9-system.ddl", SYSTEM_TEXT))
        .clone()
}

/// The names of the models that are built in.
pub const NAMES: [&str; 1] = ["k9-system"];

/// The model of a name, if it is built in.
pub fn named(name: &str) -> Option<Arc<Model>> {
    match name {
        "k9-system" => Some(system()),
        _ => None,
    }
}

fn read(name: &str, text: &str) -> Arc<Model> {
    let read = read_model(name, text, &Options::default());
    let model = read.ok().unwrap_or_else(|findings| panic!("{findings}"));
    Arc::new(model)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_is_proved() {
        let options = Options {
            strict: true,
            ..Options::default()
        };
        for (name, text) in [("k9-system.ddl", SYSTEM_TEXT)] {
            let read = read_model(name, text, &options);
            let findings: Vec<String> = read.findings.iter().map(ToString::to_string).collect();
            assert_eq!(findings, Vec::<String>::new());
            let formatted = format(text).expect("it is well formed");
            if std::env::var("BLESS").is_ok() {
                std::fs::write(
                    format!("{}/models/{name}", env!("CARGO_MANIFEST_DIR")),
                    &formatted,
                )
                .unwrap();
            }
            assert_eq!(formatted, text);
        }
    }
}
