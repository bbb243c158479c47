//! The checks that make a graph a roadmap, each with an error that names what breaks it.

use nalgebra::Point2;

use super::{MAX_COORDINATE_M, MAX_VERTICES};
use crate::error::RoadmapError;
use crate::ids::VertexId;

/// Checks counts, ranges and duplicates. `edges` are (lower, higher), sorted.
pub(super) fn graph(
    positions_m: &[Point2<f64>],
    edges: &[(VertexId, VertexId)],
    boundary: &[VertexId],
) -> Result<(), RoadmapError> {
    let vertices = positions_m.len();
    if vertices == 0 {
        return Err(RoadmapError::Empty);
    }
    if vertices > MAX_VERTICES {
        return Err(RoadmapError::TooManyVertices {
            limit: MAX_VERTICES,
            actual: vertices,
        });
    }
    for (p, vertex) in positions_m.iter().zip((0..).map(VertexId)) {
        // Written so that a NaN fails.
        if !(p.x.abs() <= MAX_COORDINATE_M && p.y.abs() <= MAX_COORDINATE_M) {
            let (x_m, y_m, limit_m) = (p.x, p.y, MAX_COORDINATE_M);
            return Err(RoadmapError::Position {
                vertex,
                x_m,
                y_m,
                limit_m,
            });
        }
    }
    for &(u, v) in edges {
        // The higher end is out of range if either is.
        if v.0 as usize >= vertices {
            return Err(RoadmapError::UnknownVertex {
                place: "edges",
                vertex: v,
                vertices,
            });
        }
        if u == v {
            return Err(RoadmapError::SelfLoop { vertex: u });
        }
    }
    if let Some(pair) = edges.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(RoadmapError::DuplicateEdge { edge: pair[0] });
    }
    let limit = if vertices < 3 {
        vertices - 1
    } else {
        3 * vertices - 6
    };
    if edges.len() > limit {
        return Err(RoadmapError::TooManyEdges {
            vertices,
            limit,
            actual: edges.len(),
        });
    }
    on_boundary(vertices, boundary)
}

fn on_boundary(vertices: usize, boundary: &[VertexId]) -> Result<(), RoadmapError> {
    if boundary.is_empty() {
        return Err(RoadmapError::EmptyBoundary);
    }
    let mut seen = vec![false; vertices];
    for &vertex in boundary {
        match seen.get_mut(vertex.0 as usize) {
            None => {
                return Err(RoadmapError::UnknownVertex {
                    place: "boundary",
                    vertex,
                    vertices,
                });
            }
            Some(true) => return Err(RoadmapError::DuplicateBoundary { vertex }),
            Some(free) => *free = true,
        }
    }
    Ok(())
}

/// Checks that there is one height within the limit for each vertex.
pub(super) fn heights(vertices: usize, heights_m: &[f64]) -> Result<(), RoadmapError> {
    if heights_m.len() != vertices {
        return Err(RoadmapError::HeightCount {
            vertices,
            actual: heights_m.len(),
        });
    }
    for (&height_m, vertex) in heights_m.iter().zip((0..).map(VertexId)) {
        if height_m.is_nan() || height_m.abs() > MAX_COORDINATE_M {
            let limit_m = MAX_COORDINATE_M;
            return Err(RoadmapError::Height {
                vertex,
                height_m,
                limit_m,
            });
        }
    }
    Ok(())
}

/// Checks that no two vertices coincide and no two edges meet elsewhere than at a common end.
pub(super) fn embedding(
    positions_m: &[Point2<f64>],
    edges: &[(VertexId, VertexId)],
) -> Result<(), RoadmapError> {
    let at = |v: VertexId| positions_m[v.0 as usize];
    let mut order: Vec<VertexId> = (0..positions_m.len() as u32).map(VertexId).collect();
    order.sort_by(|&a, &b| {
        let (p, q) = (at(a), at(b));
        p.x.total_cmp(&q.x)
            .then(p.y.total_cmp(&q.y))
            .then(a.cmp(&b))
    });
    // -0.0 sorts before 0.0 but is the same place, so compare along each run of equal x.
    for (i, &first) in order.iter().enumerate() {
        let run = order[i + 1..]
            .iter()
            .take_while(|&&v| at(v).x == at(first).x);
        if let Some(&second) = run.clone().find(|&&v| at(v).y == at(first).y) {
            let (first, second) = (first.min(second), first.max(second));
            return Err(RoadmapError::Coincident { first, second });
        }
    }
    // Edges by their western end: only edges whose x ranges overlap can meet.
    let west = |&(u, v): &(VertexId, VertexId)| at(u).x.min(at(v).x);
    let east = |&(u, v): &(VertexId, VertexId)| at(u).x.max(at(v).x);
    let mut sweep: Vec<(VertexId, VertexId)> = edges.to_vec();
    sweep.sort_by(|a, b| west(a).total_cmp(&west(b)).then(a.cmp(b)));
    for (i, first) in sweep.iter().enumerate() {
        let reach = east(first);
        for second in sweep[i + 1..].iter().take_while(|e| west(e) <= reach) {
            if meet(positions_m, *first, *second) {
                let (first, second) = (*first.min(second), *first.max(second));
                return Err(RoadmapError::Crossing { first, second });
            }
        }
    }
    Ok(())
}

/// Whether two different edges meet elsewhere than at a common end.
fn meet(
    positions_m: &[Point2<f64>],
    first: (VertexId, VertexId),
    second: (VertexId, VertexId),
) -> bool {
    let at = |v: VertexId| positions_m[v.0 as usize];
    let (a, b, c, d) = (at(first.0), at(first.1), at(second.0), at(second.1));
    let shared = [first.0, first.1]
        .into_iter()
        .find(|&v| v == second.0 || v == second.1);
    if let Some(shared) = shared {
        let other = |e: (VertexId, VertexId)| at(if e.0 == shared { e.1 } else { e.0 });
        let (p, q, s) = (other(first), other(second), at(shared));
        // Two edges from one vertex overlap exactly when they leave it in the same direction.
        return turn(s, p, q) == 0.0 && (p - s).dot(&(q - s)) > 0.0;
    }
    segments_meet(a, b, c, d)
}

/// Whether the closed segments `ab` and `cd` have a point in common.
pub(crate) fn segments_meet(
    a: Point2<f64>,
    b: Point2<f64>,
    c: Point2<f64>,
    d: Point2<f64>,
) -> bool {
    let sign = |x: f64| (x > 0.0) as i8 - (x < 0.0) as i8;
    let (c_side, d_side) = (sign(turn(a, b, c)), sign(turn(a, b, d)));
    let (a_side, b_side) = (sign(turn(c, d, a)), sign(turn(c, d, b)));
    if c_side * d_side < 0 && a_side * b_side < 0 {
        return true;
    }
    (c_side == 0 && within(a, b, c))
        || (d_side == 0 && within(a, b, d))
        || (a_side == 0 && within(c, d, a))
        || (b_side == 0 && within(c, d, b))
}

/// Positive where `a`, `b`, `c` turn left, 0 where they lie on a line.
fn turn(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> f64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// Whether `p`, on the line through `a` and `b`, lies between them.
fn within(a: Point2<f64>, b: Point2<f64>, p: Point2<f64>) -> bool {
    a.x.min(b.x) <= p.x && p.x <= a.x.max(b.x) && a.y.min(b.y) <= p.y && p.y <= a.y.max(b.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::roadmap::Roadmap;

    fn build(
        points: &[(f64, f64)],
        edges: &[(u32, u32)],
        boundary: &[u32],
    ) -> Result<Roadmap, RoadmapError> {
        let positions_m = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        let edges = edges
            .iter()
            .map(|&(u, v)| (VertexId(u), VertexId(v)))
            .collect();
        let boundary = boundary.iter().map(|&v| VertexId(v)).collect();
        Roadmap::new("test", positions_m, edges, boundary)
    }

    const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];

    #[test]
    fn each_rule_has_its_error() {
        use RoadmapError as E;
        let v = VertexId;
        let cases: Vec<(Result<Roadmap, E>, E)> = vec![
            (build(&[], &[], &[]), E::Empty),
            (build(&SQUARE[..1], &[], &[]), E::EmptyBoundary),
            (
                build(&SQUARE[..2], &[(0, 1)], &[1, 1]),
                E::DuplicateBoundary { vertex: v(1) },
            ),
            (
                build(&SQUARE[..2], &[(0, 1)], &[2]),
                E::UnknownVertex {
                    place: "boundary",
                    vertex: v(2),
                    vertices: 2,
                },
            ),
            (
                build(&SQUARE[..2], &[(7, 1)], &[0]),
                E::UnknownVertex {
                    place: "edges",
                    vertex: v(7),
                    vertices: 2,
                },
            ),
            (
                build(&SQUARE[..2], &[(1, 1)], &[0]),
                E::SelfLoop { vertex: v(1) },
            ),
            (
                build(&SQUARE[..3], &[(0, 1), (1, 0), (1, 2)], &[0]),
                E::DuplicateEdge { edge: (v(0), v(1)) },
            ),
            (
                build(&SQUARE, &[(0, 1), (2, 3)], &[0]),
                E::Disconnected { unreachable: v(2) },
            ),
            (
                build(&SQUARE, &[(0, 2), (0, 1), (1, 3)], &[0]),
                E::Crossing {
                    first: (v(0), v(2)),
                    second: (v(1), v(3)),
                },
            ),
            (
                build(
                    &[(0.0, 0.0), (1.0, 0.0), (-0.0, 0.0)],
                    &[(0, 1), (1, 2)],
                    &[0],
                ),
                E::Coincident {
                    first: v(0),
                    second: v(2),
                },
            ),
        ];
        for (result, expected) in cases {
            assert_eq!(result.unwrap_err(), expected);
        }
        let nan = build(&[(f64::NAN, 0.0)], &[], &[0]).unwrap_err();
        assert!(
            matches!(
                nan,
                E::Position {
                    vertex: VertexId(0),
                    ..
                }
            ),
            "{nan}"
        );
        let all = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
        let ten = [&all[..], &all[..]].concat();
        assert!(matches!(
            build(&SQUARE, &ten, &[0]),
            Err(E::DuplicateEdge { .. })
        ));
    }

    #[test]
    fn touching_and_overlapping_edges_are_crossings() {
        // A vertex in the middle of another edge.
        let tee = [(0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (1.0, 1.0)];
        let error = build(&tee, &[(0, 1), (2, 3), (1, 3)], &[0]).unwrap_err();
        assert!(matches!(error, RoadmapError::Crossing { .. }), "{error}");
        // Two edges from one vertex in the same direction.
        let line = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)];
        let error = build(&line, &[(0, 1), (0, 2)], &[0]).unwrap_err();
        assert!(matches!(error, RoadmapError::Crossing { .. }), "{error}");
        assert!(build(&line, &[(0, 1), (1, 2)], &[0]).is_ok());
    }

    #[test]
    fn heights_are_one_for_each_vertex() {
        let map = build(&SQUARE[..2], &[(0, 1)], &[0]).unwrap();
        let short = map.clone().with_heights_m(vec![1.0]).unwrap_err();
        assert_eq!(
            short,
            RoadmapError::HeightCount {
                vertices: 2,
                actual: 1
            }
        );
        assert!(map.clone().with_heights_m(vec![1.0, f64::NAN]).is_err());
        assert_eq!(
            map.with_heights_m(vec![1.0, 2.0])
                .unwrap()
                .height_m(VertexId(1)),
            2.0
        );
    }
}
