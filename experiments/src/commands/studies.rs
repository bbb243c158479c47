//! `farside studies`: what is built in.

use serde::Serialize;

use super::{CommandError, print, print_json};
use crate::cli::Exit;
use crate::study::{Study, builtin_names, builtin_text};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Print the texts of the studies instead, as TOML, for copying
    #[arg(long, conflicts_with = "json")]
    text: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Entry {
    name: &'static str,
    question: String,
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
    let mut entries = Vec::new();
    for name in builtin_names() {
        let question = Study::open(name)?.question().to_owned();
        entries.push(Entry { name, question });
    }
    if args.json {
        print_json(&entries)?;
        return Ok(Exit::Done);
    }
    let width = entries.iter().map(|e| e.name.len()).max().unwrap_or(0);
    let lines = entries
        .iter()
        .map(|e| format!("{:width$}  {}", e.name, e.question));
    print(lines.collect::<Vec<_>>().join("\n"))?;
    Ok(Exit::Done)
}
