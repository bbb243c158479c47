//! `farside scenarios` and `farside studies`: what is built in.

use serde_json::json;

use super::{CommandError, print, print_json};
use crate::cli::Exit;
use crate::{scenario, study};

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
struct Shelf {
    names: Vec<&'static str>,
    text: fn(&str) -> Option<&'static str>,
    /// The key whose value says what a file is for.
    about: &'static str,
}

pub(crate) fn scenarios(args: &Args) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        names: scenario::builtin_names(),
        text: scenario::builtin_text,
        about: "description",
    };
    shelf.list(args)
}

pub(crate) fn studies(args: &Args) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        names: study::builtin_names(),
        text: study::builtin_text,
        about: "question",
    };
    shelf.list(args)
}

impl Shelf {
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
