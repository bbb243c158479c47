//! `farside scenarios` and `farside studies`: what is built in.

use farside::suggest::{did_you_mean, nearest};
use farside_actors::system::Builtin;
use serde_json::json;

use super::Exit;
use super::{CommandError, print, print_document, print_json};
use crate::registry::Registry;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Print the text of this one, as TOML, for copying
    #[arg(value_name = "NAME")]
    name: Option<String>,
    /// Print the texts of all, as TOML
    #[arg(long, conflicts_with_all = ["json", "name"])]
    text: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Files that are built in.
struct Shelf {
    /// What one of them is.
    what: &'static str,
    files: Vec<Builtin>,
    /// The key whose value says what a file is for.
    about: &'static str,
}

pub(crate) fn scenarios(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        what: "scenario",
        files: registry.scenarios(),
        about: "description",
    };
    shelf.list(args)
}

pub(crate) fn studies(args: &Args, registry: &Registry) -> Result<Exit, CommandError> {
    let shelf = Shelf {
        what: "study",
        files: registry.studies(),
        about: "question",
    };
    shelf.list(args)
}

impl Shelf {
    fn list(&self, args: &Args) -> Result<Exit, CommandError> {
        if let Some(name) = &args.name {
            return self.show(name, args.json);
        }
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

    /// Prints one, whole.
    fn show(&self, name: &str, as_json: bool) -> Result<Exit, CommandError> {
        let Some(file) = self.files.iter().find(|file| file.name == name) else {
            let names = self.files.iter().map(|file| file.name);
            let hint = did_you_mean(nearest(name, names.clone()).as_deref());
            let (what, known) = (self.what, names.collect::<Vec<_>>().join(", "));
            return Err(CommandError::Arguments(format!(
                "{name}: no {what} of this name is built in{hint}\n  built in: {known}"
            )));
        };
        if as_json {
            let (name, text) = (file.name, file.text);
            print_json(&json!({ "name": name, self.about: self.about(file), "text": text }))?;
        } else {
            print_document(file.text)?;
        }
        Ok(Exit::Done)
    }

    /// What a file is for, in its own words.
    fn about(&self, file: &Builtin) -> String {
        let table = file.text.parse::<toml::Table>().ok();
        let about = table.as_ref().and_then(|table| table.get(self.about));
        about.and_then(toml::Value::as_str).unwrap_or("").to_owned()
    }
}
