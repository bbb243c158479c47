//! `farside scenarios` and `farside studies`: what is built in.

use farside_actors::system::Builtin;
use serde_json::json;

use super::Exit;
use super::{CommandError, print, print_document, print_json};
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
struct Shelf {
    files: Vec<Builtin>,
    /// The key whose value says what a file is for.
    about: &'static str,
}

pub(crate) fn scenarios(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        files: registry.scenarios(),
        about: "description",
    };
    shelf.list(args)
}

pub(crate) fn studies(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        files: registry.studies(),
        about: "question",
    };
    shelf.list(args)
}

impl Shelf {
    fn list(&self, args: &Args) -> Result<Exit, CommandError> {
        let files = self.files.iter();
        if args.text {
            let texts = files.map(|file| format!("# --- {}\n{}", file.name, file.text));
            print_document(&texts.collect::<Vec<_>>().join("\n"))?;
            return Ok(Exit::Done);
        }
        if args.json {
            let entry = |file: &Builtin| json!({ "name": file.name, self.about: self.about(file) });
            print_json(&files.map(entry).collect::<Vec<_>>())?;
            return Ok(Exit::Done);
        }
        let width = files.clone().map(|file| file.name.len()).max().unwrap_or(0);
        let lines = files.map(|file| format!("{:width$}  {}", file.name, self.about(file)));
        print(lines.collect::<Vec<_>>().join("\n"))?;
        Ok(Exit::Done)
    }

    /// What a file is for, in its own words.
    fn about(&self, file: &Builtin) -> String {
        let table = file.text.parse::<toml::Table>().ok();
        let about = table.as_ref().and_then(|table| table.get(self.about));
        about.and_then(toml::Value::as_str).unwrap_or("").to_owned()
    }
}
