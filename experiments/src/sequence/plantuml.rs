//! Sequence charts for PlantUML: <https://plantuml.com/sequence-diagram>.

use farside_logs::escaped;

use super::{Chart, Fate, Step};

pub(super) fn write(chart: &Chart) -> String {
    let mut text = format!("@startuml\ntitle {}\n", plain(&chart.title));
    for (at, name) in chart.participants.iter().enumerate() {
        text.push_str(&format!("participant \"{}\" as a{at}\n", plain(name)));
    }
    for step in &chart.steps {
        match step {
            Step::Arrow(arrow) => {
                let line = match arrow.fate {
                    Fate::Delivered => "->",
                    Fate::Lost => "->x",
                    Fate::InFlight => "-->>",
                };
                let (from, to) = (arrow.sender, arrow.receiver);
                let label = plain(&arrow.label());
                text.push_str(&format!("a{from} {line} a{to} : {label}\n"));
            }
            Step::Note(note) => {
                let label = plain(&note.text);
                match note.beside {
                    Some(beside) => text.push_str(&format!("note over a{beside} : {label}\n")),
                    None => text.push_str(&format!("note across : {label}\n")),
                }
            }
        }
    }
    for remark in &chart.remarks {
        text.push_str(&format!("' {}\n", escaped(remark)));
    }
    text.push_str("@enduml\n");
    text
}

/// A text in which nothing means something else: Creole's marks, which are letters twice, tags, and what ends a text.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut last = ' ';
    for letter in escaped(text).chars() {
        let is_mark = matches!(letter, '*' | '/' | '-' | '_' | '~' | '.' | '=') && letter == last;
        match letter {
            '"' | '<' | '>' | '&' | '\\' | '%' | '$' | '#' | '[' | ']' => {
                plain.push_str(&format!("&#{};", u32::from(letter)));
            }
            _ if is_mark => plain.push_str(&format!("&#{};", u32::from(letter))),
            _ => plain.push(letter),
        }
        last = letter;
    }
    plain
}
