//! How the figures are made: formulas by name, and whose they are.

use maud::{Markup, html};

use crate::report::measure::Study;
use crate::stats::bootstrap::RESAMPLES;

/// A method: what it is for, and how it is done.
type Method = (&'static str, &'static str);

const METHODS: [Method; 12] = [
    (
        "Means",
        "The interval is a bootstrap's, bias-corrected and accelerated (BCa; Efron 1987), because \
         times and losses on bad links are skewed.",
    ),
    (
        "Interquartile means",
        "The mean of the middle half of the runs: one bad run in thirty does not move it. \
         Intervals as for means.",
    ),
    (
        "Differences to the baseline",
        "Runs with the same seed are paired, and the interval is a bootstrap over the seeds that \
         both cells have: what a seed does to both drops out.",
    ),
    (
        "Rates",
        "The interval is Wilson's (1927), which says something at 0 and at 100 % too. Differences \
         of rates have Newcombe's interval for pairs (1998, method 10), and McNemar's test (1947), \
         exact and two-sided: the two counts are the seeds with which it is true only here, and \
         only in the baseline.",
    ),
    (
        "Blocks",
        "Where seeds share a problem in blocks, what is drawn and paired are blocks: five runs on \
         one problem do not say what five problems do. Bootstraps draw whole blocks. Rates count \
         for as many runs as their blocks are worth (Rao and Scott 1992), and in McNemar's test \
         chance decides the sign of a whole block (exact randomisation test, Fisher 1935).",
    ),
    (
        "Curves",
        "Means and differences index by index, as for numbers, from the same draws at each index. \
         Student's test over the blocks' mean differences gives a p for each index, and Holm's \
         method (1979) holds all indices of one curve against the baseline together.",
    ),
    (
        "Survival",
        "Kaplan and Meier's curve (1958). Its variance sums the squared influence of each run, as \
         things in one run share its fate (Williams 1995); if each run lists one thing, that is \
         Greenwood's formula (1926). The interval is laid over log(-log). The interval of the \
         median is where the band holds one half (Brookmeyer and Crowley 1982).",
    ),
    (
        "Distributions",
        "Empirical, over the values of all runs of a cell. Quantiles are interpolated (definition \
         7 of Hyndman and Fan 1996, as in numpy and R); of what did not always happen they are the \
         times at which the survival curve passes the share.",
    ),
    (
        "Over all cells",
        "A stratified bootstrap: seeds are drawn anew within each cell, and the interval is the \
         percentiles' (Agarwal and others 2021, rliable).",
    ),
    (
        "Published figures",
        "They have no intervals of their own, so the question is whether ours allows them: whether \
         it holds the published figure, or reaches into what a bound such as \u{201c}under 1 \
         %\u{201d} allows. Of twenty figures that agree in truth, about one is outside by chance. \
         What was published to be linear has a line through the cells' figures by least squares, \
         each cell counted the same, and R\u{b2}, the share of their spread that the line \
         explains; curves that only bend upwards a little have a high one too, so the farthest \
         cell is named as well.",
    ),
    (
        "Published comparisons",
        "That a cell exceeds another is judged by the paired interval. Of curves the claim is for \
         each index from one on: it holds if each interval says so, and does not hold if one says \
         the contrary and Student's p against the broken bound, adjusted by Holm for these \
         indices, is at most 0.05. That two are equal within a margin holds if the 95 % interval \
         is within it, which is stricter than two one-sided tests at 5 %.",
    ),
    (
        "Many comparisons",
        "Intervals and p are for one comparison each. Of many that are made at once, some stand \
         out by chance: nothing is corrected for that but the number of indices of a curve.",
    ),
];

pub(super) fn section(study: &Study<'_>) -> Markup {
    let blocks = study.results.manifest.block > 1;
    let drawn = if blocks { "blocks of seeds" } else { "seeds" };
    html! {
        section id="method" {
            h2 { "How the figures are made" }
            p {
                "All intervals are at 95 %: of many such intervals 95 in 100 hold the true value. \
                 Bootstraps draw " (RESAMPLES) " times, from streams that are addressed by the \
                 names of metric and cell, so the same results give the same report. Runs that \
                 failed are in no figure; a run that has no value of a metric does not count for \
                 it, as the column of runs shows. results.csv has every run, summary.csv every \
                 figure in full."
            }
            @if study.blocks(study.results.manifest.seeds.len()) < 20 {
                p class="bad" {
                    "With fewer than 20 " (drawn) " a cell, intervals of means are too narrow: a \
                                                   bootstrap draws no value that was not seen. 30 \
                                                   are better."
                }
            }
            dl {
                @for (what, how) in METHODS {
                    dt { (what) }
                    dd { (how) }
                }
            }
        }
    }
}
