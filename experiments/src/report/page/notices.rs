//! What has no effect in a study, said where its flat lines are: a line that is flat because what
//! was varied never came into play reads as robust.

use maud::{Markup, html};

use crate::report::measure::Study;
use crate::study::summary::effect;

/// The notices of a study; most have none.
pub(super) fn of(study: &Study<'_>) -> Vec<String> {
    effect::notices(&study.results.manifest, study.summary)
}

/// The notices, before anything else is read.
pub(super) fn first(notices: &[String]) -> Markup {
    html! {
        @if !notices.is_empty() {
            section id="no-effect" aria-label="What has no effect" {
                @for notice in notices {
                    p { span class="bad" { "No effect: " } (notice) "." }
                }
            }
        }
    }
}

/// The notices again, beside the plots that they are about.
pub(super) fn beside(notices: &[String]) -> Markup {
    html! {
        @for notice in notices {
            p class="note" { "No effect: " (notice) "." }
        }
    }
}
