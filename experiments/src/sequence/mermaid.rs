//! Sequence charts for Mermaid: <https://mermaid.js.org/syntax/sequenceDiagram.html>.

use farside_logs::escaped;

use super::{Chart, Fate, Step};

pub(super) fn write(chart: &Chart) -> String {
    let mut text = format!(
        "---\ntitle: {}\n---\nsequenceDiagram\n",
        quoted(&chart.title)
    );
    for (at, name) in chart.participants.iter().enumerate() {
        text.push_str(&format!("  participant a{at} as {}\n", plain(name)));
    }
    let last = chart.participants.len().saturating_sub(1);
    for step in &chart.steps {
        match step {
            Step::Arrow(arrow) => {
                let line = match arrow.fate {
                    Fate::Delivered => "->>",
                    Fate::Lost => "-x",
                    Fate::InFlight => "--)",
                };
                let (from, to) = (arrow.sender, arrow.receiver);
                let label = plain(&arrow.label());
                text.push_str(&format!("  a{from}{line}a{to}: {label}\n"));
            }
            Step::Note(note) => {
                let over = match note.beside {
                    Some(beside) => format!("a{beside}"),
                    None if chart.participants.is_empty() => continue,
                    None if last == 0 => "a0".to_owned(),
                    None => format!("a0,a{last}"),
                };
                text.push_str(&format!("  Note over {over}: {}\n", plain(&note.text)));
            }
        }
    }
    for remark in &chart.remarks {
        text.push_str(&format!("  %% {}\n", escaped(remark)));
    }
    text
}

/// A text in which nothing means something else: `;` ends a line, `#` begins a letter's code, `%%` a comment.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for letter in escaped(text).chars() {
        match letter {
            ';' | '#' | '%' | '<' | '>' | '&' | '"' | '{' | '}' => {
                plain.push_str(&format!("#{};", u32::from(letter)));
            }
            _ => plain.push(letter),
        }
    }
    plain
}

/// A text of YAML.
fn quoted(text: &str) -> String {
    let text = escaped(text);
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
