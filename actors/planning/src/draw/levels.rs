//! The levels of resources at the fixed times of a plan, as steps between limits.

use super::marks::{Sheet, shortened, text_width};
use super::{Chart, LEVELS, RIGHT, WIDTH};
use crate::Ticks;
use crate::plan::{Plan, PlanEffectKind, PlanEnd, PlanResource, PlanResourceKind};

/// Draws a resource's levels below `top`.
pub(super) fn draw(chart: &Chart<'_>, sheet: &mut Sheet, resource: &PlanResource, top: f64) {
    let steps = levels(chart.plan, resource);
    let shown = steps.iter().take_while(|&&(at, _)| at <= chart.until);
    let values = || shown.clone().map(|&(_, level)| level);
    let limits = resource.limits.map(|limit| limit.map(i128::from));
    let all = || values().chain(limits.iter().flatten().copied()).chain([0]);
    let (low, high) = (all().min().unwrap_or(0), all().max().unwrap_or(0));
    let height = LEVELS - 12.0;
    let range = (high - low).max(1) as f64;
    let y = |level: i128| top + height - (level - low) as f64 / range * height;
    let (left, right) = (chart.left, WIDTH - RIGHT);

    sheet.text([8.0, top - 12.0], "bold", &shortened(&resource.name, 40));
    let kind = match resource.kind {
        PlanResourceKind::Renewable => "renewable".to_owned(),
        PlanResourceKind::Depletable => "depletable".to_owned(),
        PlanResourceKind::RateLimited(window) => format!("limited within {window} ticks"),
    };
    let after_name = 8.0 + 1.12 * text_width(&shortened(&resource.name, 40)) + 10.0;
    sheet.text([after_name, top - 12.0], "soft", &kind);

    let mut points: Vec<[f64; 2]> = Vec::new();
    for &(at, level) in shown.clone() {
        let x = chart.x(at);
        if let Some(&[_, before]) = points.last() {
            points.push([x, before]);
        }
        points.push([x, y(level)]);
    }
    if let Some(&[_, last]) = points.last() {
        points.push([right, last]);
    }
    let base = y(low.max(0).min(high));
    let mut area = vec![[left, base]];
    area.extend(&points);
    area.push([right, base]);
    sheet.path("under", &area);
    wrong(chart, sheet, &steps, limits, &y);
    sheet.line([left, base], [right, base], "axis");
    for limit in limits.into_iter().flatten() {
        sheet.line([left, y(limit)], [right, y(limit)], "limit");
    }
    sheet.path("level", &points);

    // The limits, and the extremes where they are not on them.
    let mut written: Vec<f64> = Vec::new();
    let extremes = [values().max(), values().min()];
    for value in limits.into_iter().rev().chain(extremes).flatten() {
        let at = y(value);
        if written.iter().all(|other: &f64| (other - at).abs() >= 13.0) {
            sheet.text([left - 10.0, at + 4.5], "tick end", &value.to_string());
            written.push(at);
        }
    }
}

/// Shades the times at which a level is outside its limits.
fn wrong(
    chart: &Chart<'_>,
    sheet: &mut Sheet,
    steps: &[(Ticks, i128)],
    [least, most]: [Option<i128>; 2],
    y: &impl Fn(i128) -> f64,
) {
    for (place, &(from, level)) in steps.iter().enumerate() {
        let limit = match (least, most) {
            (Some(least), _) if level < least => least,
            (_, Some(most)) if level > most => most,
            _ => continue,
        };
        let to = steps.get(place + 1).map_or(chart.until, |&(at, _)| at);
        let [from, to] = [chart.x(from), chart.x(to)];
        let corners = [
            [from, y(limit)],
            [to, y(limit)],
            [to, y(level)],
            [from, y(level)],
        ];
        sheet.path("wrong", &corners);
    }
}

/// From when on a resource has which level, from time 0 on.
pub(super) fn levels(plan: &Plan, resource: &PlanResource) -> Vec<(Ticks, i128)> {
    let mut changes: Vec<(Ticks, i128)> = Vec::new();
    changes.extend(
        resource
            .changes
            .iter()
            .map(|&(at, by)| (at, i128::from(by))),
    );
    for token in &plan.tokens {
        let effects = token
            .effects
            .iter()
            .filter(|effect| effect.resource == resource.name);
        for effect in effects {
            let end = |end: PlanEnd| match end {
                PlanEnd::Start => token.start,
                PlanEnd::End => token.end,
            };
            let amount = i128::from(effect.amount);
            let (at, by, over) = match effect.does {
                PlanEffectKind::Uses => (token.start, -amount, Some(token.end)),
                PlanEffectKind::Consumes(at) => (end(at), -amount, None),
                PlanEffectKind::Produces(at) => (end(at), amount, None),
            };
            let over = match resource.kind {
                PlanResourceKind::RateLimited(window) if by < 0 => Some(at.saturating_add(window)),
                _ => over,
            };
            changes.push((at, by));
            changes.extend(over.map(|over| (over, -by)));
        }
    }
    changes
        .iter_mut()
        .for_each(|change| change.0 = change.0.max(0));
    changes.sort_by_key(|change| change.0);
    let mut steps = vec![(0, i128::from(resource.initial))];
    for (at, by) in changes {
        let (last, level) = steps[steps.len() - 1];
        let level = level + by;
        match at == last {
            true => *steps.last_mut().unwrap_or(&mut (0, 0)) = (at, level),
            false => steps.push((at, level)),
        }
    }
    steps
}
