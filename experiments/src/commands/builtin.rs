//! `farside scenarios` and `farside studies`: what is built in.

use serde_json::json;

use super::Exit;
use super::{CommandError, print, print_json};
use crate::registry::Registry;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Print the texts instead, as TOML, for copying
    #[arg(long, conflicts_with = "json")]
    text: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Files that are built in.
struct Shelf<'a> {
    names: Vec<&'a str>,
    text: Box<dyn Fn(&str) -> Option<&'static str> + 'a>,
    /// The key whose value says what a file is for.
    about: &'static str,
}

pub(crate) fn scenarios(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        names: registry.scenario_names(),
        text: Box::new(|name| registry.scenario(name)),
        about: "description",
    };
    shelf.list(args)
}

pub(crate) fn studies(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        names: registry.study_names(),
        text: Box::new(|name| registry.study(name)),
        about: "question",
    };
    shelf.list(args)
}

impl Shelf<'_> {
    fn list(&self, args: &Args) -> Result<Exit, CommandError> {
        if args.text {
            let texts = self.names.iter().map(|name| {
                let text = (self.text)(name).unwrap_or_default();
                format!("# --- {name}\n{text}")
            });
            print(texts.collect::<Vec<_>>().join("\n"))?;
            return Ok(Exit::Done);
        }
        if args.json {
            let entry = |name: &&str| json!({ "name": name, self.about: self.about(name) });
            print_json(&self.names.iter().map(entry).collect::<Vec<_>>())?;
            return Ok(Exit::Done);
        }
        let width = self.names.iter().map(|name| name.len()).max().unwrap_or(0);
        let lines = self.names.iter();
        let lines = lines.map(|name| format!("{name:width$}  {}", self.about(name)));
        print(lines.collect::<Vec<_>>().join("\n"))?;
        Ok(Exit::Done)
    }

    /// What a file is for, in its own words.
    fn about(&self, name: &str) -> String {
        let table = (self.text)(name).and_then(|text| text.parse::<toml::Table>().ok());
        let about = table.as_ref().and_then(|table| table.get(self.about));
        about.and_then(toml::Value::as_str).unwrap_or("").to_owned()
    }
}
