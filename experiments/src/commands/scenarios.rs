//! `farside scenarios`: what is built in.

use serde::Serialize;

use super::{CommandError, print, print_json};
use crate::cli::Exit;
use crate::scenario::{builtin_names, builtin_text};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Print the texts of the scenarios instead, as TOML, for copying
    #[arg(long, conflicts_with = "json")]
    text: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Entry {
    name: &'static str,
    description: String,
}

pub(crate) fn run(args: &Args) -> Result<Exit, CommandError> {
    if args.text {
        let texts = builtin_names().into_iter().map(|name| {
            let text = builtin_text(name).unwrap_or_default();
            format!("# --- {name}\n{text}")
        });
        print(texts.collect::<Vec<_>>().join("\n"))?;
        return Ok(Exit::Done);
    }
    let entries: Vec<Entry> = builtin_names().into_iter().map(entry).collect();
    if args.json {
        print_json(&entries)?;
        return Ok(Exit::Done);
    }
    let width = entries.iter().map(|e| e.name.len()).max().unwrap_or(0);
    let lines = entries
        .iter()
        .map(|e| format!("{:width$}  {}", e.name, e.description));
    print(lines.collect::<Vec<_>>().join("\n"))?;
    Ok(Exit::Done)
}

fn entry(name: &'static str) -> Entry {
    let table = builtin_text(name).and_then(|text| text.parse::<toml::Table>().ok());
    let description = table.as_ref().and_then(|table| table.get("description"));
    Entry {
        name,
        description: description
            .and_then(toml::Value::as_str)
            .unwrap_or("")
            .to_owned(),
    }
}
