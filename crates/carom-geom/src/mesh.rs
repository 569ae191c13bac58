//! Surfaces made of triangles, and what of them a sphere meets.
//!
//! A sphere meets a mesh wherever its distance from it has a local minimum: over flat pieces, at edges and tips that bulge towards
//! it, in a corner at two or three pieces at once. So the parts of a mesh are its flat pieces, each a plane; its edges between
//! them, each a line; and the ends of these, each a point. Triangles say which part is near ([`Mesh::met`]); what happens at a
//! part does not know of them. Therefore no triangle of a flat piece is felt, whatever the triangulation.
//!
//! A mesh gives as many walls as it has triangles and parts, triangles first.

use crate::pair::{slack, Nearest, SLACK};
use crate::pair::{Ball, Line, Proximity, Sheet, Triangle};
use crate::shape::Shape;
use glam::DVec3;
use std::collections::HashMap;

/// Distance over the largest coordinate (1) up to which corners lie in one plane: files hold single precision. At 0 the edges
/// of flat pieces are felt by what rolls over them; too large, and fine curved meshes have flat pieces.
const FLAT: f64 = 2e-7;
/// Cosine of the angle between normals of one flat piece: of triangles so small that all their corners are near any plane.
const ALIKE: f64 = 0.999;
/// Normals (rad) and gaps over the radius (1) of one sphere at one mesh that differ by less are those of one contact. Less than
/// [`SLACK`], and an edge were met besides the piece that it ends.
const SAME: f64 = 10.0 * SLACK;
/// Least height over the longest edge (1) of a triangle with a direction of its own.
const THIN: f64 = 1e-10;

/// Whether two contacts of one sphere of radius `r` (m) with one mesh are one and the same.
#[inline]
pub fn same_contact(a: &Proximity, b: &Proximity, r: f64) -> bool {
    (a.normal - b.normal).length_squared() < SAME * SAME && (a.gap - b.gap).abs() < SAME * r
}

/// A surface of triangles, and which of them touch one another.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Triangles, pieces, edges, corners: where they are given.
    walls: Vec<Shape>,
    corners: Vec<[u32; 3]>,
    edges: Vec<[u32; 3]>,
    at_edge: Groups,
    at_corner: Groups,
    /// Place among the walls of the piece of each triangle, of each edge and corner; [`NONE`]: within a piece.
    piece: Vec<u32>,
    edge_wall: Vec<u32>,
    corner_wall: Vec<u32>,
    /// Which part each wall is, see [`Mesh::part`].
    parts: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// A triangle that cannot be used, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct BadTriangle {
    pub triangle: usize,
    pub why: String,
}

/// Triangles of many edges, or corners, one list after the other.
#[derive(Clone, Debug)]
struct Groups {
    start: Vec<u32>,
    members: Vec<u32>,
}

impl Groups {
    fn new(of: &[[u32; 3]], count: usize) -> Groups {
        let mut start = vec![0u32; count + 1];
        for &group in of.iter().flatten() {
            start[group as usize + 1] += 1;
        }
        for k in 0..count {
            start[k + 1] += start[k];
        }
        let mut next = start.clone();
        let mut members = vec![0; 3 * of.len()];
        for (t, groups) in of.iter().enumerate() {
            for &group in groups {
                let to = &mut next[group as usize];
                members[*to as usize] = t as u32;
                *to += 1;
            }
        }
        Groups { start, members }
    }

    fn of(&self, group: u32) -> &[u32] {
        let at = |k: usize| self.start[k] as usize;
        &self.members[at(group as usize)..at(group as usize + 1)]
    }
}

impl Mesh {
    /// A mesh of points (m) and triangles, counterclockwise seen from the front. Triangles are neighbours where they share points
    /// by number: equal points of a file are to be one.
    pub fn new(points: &[DVec3], corners: &[[u32; 3]]) -> Result<Mesh, BadTriangle> {
        let mut triangles = Vec::with_capacity(corners.len());
        for (t, named) in corners.iter().enumerate() {
            triangles
                .push(triangle(points, named).map_err(|why| BadTriangle { triangle: t, why })?);
        }
        let (edges, ends) = number_edges(corners);
        let mut mesh = Mesh {
            walls: Vec::new(),
            at_edge: Groups::new(&edges, ends.len()),
            at_corner: Groups::new(corners, points.len()),
            piece: vec![NONE; triangles.len()],
            edge_wall: vec![NONE; ends.len()],
            corner_wall: vec![NONE; points.len()],
            parts: (0..triangles.len() as u32).map(|t| 7 * t).collect(),
            corners: corners.to_vec(),
            edges,
        };
        let (pieces, largest) = mesh.flat_pieces(&triangles);
        mesh.walls
            .extend(triangles.iter().map(|t| Shape::Triangle(*t)));
        mesh.walls.extend(pieces.into_iter().map(Shape::Sheet));
        mesh.parts.extend(largest.into_iter().map(|t| 7 * t));
        for (e, [from, to]) in ends.into_iter().enumerate() {
            let around = mesh.at_edge.of(e as u32);
            let piece = mesh.piece[around[0] as usize];
            if around.len() == 2 && mesh.piece[around[1] as usize] == piece {
                continue;
            }
            mesh.edge_wall[e] = mesh.walls.len() as u32;
            let k = place_of(&mesh.edges[around[0] as usize], e as u32);
            mesh.parts.push(7 * around[0] + 1 + k as u32);
            let point = points[from as usize];
            let along = (points[to as usize] - point).normalize();
            mesh.walls.push(Shape::Line(Line { point, along }));
            for end in [from, to] {
                mesh.corner_wall[end as usize] = 0; // wanted
            }
        }
        for (corner, &centre) in points.iter().enumerate() {
            let wall = &mut mesh.corner_wall[corner];
            if *wall != NONE {
                let first = mesh.at_corner.of(corner as u32)[0];
                let k = place_of(&mesh.corners[first as usize], corner as u32);
                mesh.parts.push(7 * first + 4 + k as u32);
                *wall = mesh.walls.len() as u32;
                let (radius, inside) = (0.0, false);
                mesh.walls.push(Shape::Ball(Ball {
                    centre,
                    radius,
                    inside,
                }));
            }
        }
        Ok(mesh)
    }

    /// Which part a wall is: 7 times a triangle of it, and 0 for the plane of that triangle, 1 to 3 for its edge from corner 0, 1
    /// or 2 to the next, 4 to 6 for these corners.
    pub fn part(&self, wall: usize) -> u32 {
        self.parts[wall]
    }

    /// How many triangles there are.
    pub fn triangles(&self) -> usize {
        self.corners.len()
    }

    /// The walls: triangles, then parts.
    pub fn walls(&self) -> &[Shape] {
        &self.walls
    }

    /// Finds which triangles join in edges and lie in one plane; returns the planes, those of the largest triangles, and
    /// which these are.
    fn flat_pieces(&mut self, triangles: &[Triangle]) -> (Vec<Sheet>, Vec<u32>) {
        let largest = |m: f64, t: &Triangle| {
            let corners = t.corners.map(|c| c.abs().max_element());
            corners.into_iter().fold(m, f64::max)
        };
        let near = FLAT * triangles.iter().fold(0.0, largest);
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let area = |t: &u32| triangles[*t as usize].across().length_squared();
        order.sort_by(|a, b| area(b).total_cmp(&area(a)).then(a.cmp(b)));
        let (mut pieces, mut largest) = (Vec::new(), Vec::new());
        for first in order {
            if self.piece[first as usize] != NONE {
                continue;
            }
            let Triangle {
                corners, normal, ..
            } = triangles[first as usize];
            let wall = (triangles.len() + pieces.len()) as u32;
            largest.push(first);
            pieces.push(Sheet {
                point: corners[0],
                normal,
            });
            self.piece[first as usize] = wall;
            let mut open = vec![first];
            while let Some(t) = open.pop() {
                for edge in self.edges[t as usize] {
                    for &other in self.at_edge.of(edge) {
                        let flat = &triangles[other as usize];
                        let level = |c: &DVec3| (*c - corners[0]).dot(normal).abs() <= near;
                        if self.piece[other as usize] == NONE
                            && flat.corners.iter().all(level)
                            && flat.normal.dot(normal).abs() > ALIKE
                        {
                            self.piece[other as usize] = wall;
                            open.push(other);
                        }
                    }
                }
            }
        }
        (pieces, largest)
    }

    /// The wall that a sphere with centre `x` (m) and radius `r` (m) may touch at triangle `t` within `reach` (m): what is nearest of
    /// it, unless a neighbour is nearer. `placed` are the walls of this mesh where they are now.
    pub fn met(&self, placed: &[Shape], t: usize, x: DVec3, r: f64, reach: f64) -> Option<usize> {
        let triangle = as_triangle(&placed[t])?;
        let far = r + reach;
        if triangle.normal.dot(x - triangle.corners[0]).abs() > far {
            return None;
        }
        let slack = slack(r, x, triangle.corners[0]);
        let wall = match triangle.nearest(x, slack) {
            Nearest::Face => self.piece[t],
            Nearest::Edge(k) => {
                let (edge, from) = (self.edges[t][k], x - triangle.corners[k]);
                let wall = self.edge_wall[edge as usize];
                let across = triangle.along(k).cross(from).length() > far * triangle.length[k];
                if wall == NONE || across || !self.is_edge_nearest(placed, t, edge, x, slack) {
                    return None;
                }
                wall
            }
            Nearest::Corner(k) => {
                let (corner, from) = (self.corners[t][k], x - triangle.corners[k]);
                let wall = self.corner_wall[corner as usize];
                let beyond = from.length_squared() > far * far;
                if wall == NONE || beyond || !self.is_corner_nearest(placed, corner, from, slack) {
                    return None;
                }
                wall
            }
        };
        Some(wall as usize)
    }

    /// Whether no other triangle at an edge of `t` is nearer to `x` than the edge is.
    fn is_edge_nearest(&self, placed: &[Shape], t: usize, edge: u32, x: DVec3, slack: f64) -> bool {
        self.at_edge.of(edge).iter().all(|&o| {
            let k = place_of(&self.edges[o as usize], edge);
            let other = as_triangle(&placed[o as usize]);
            o as usize == t || other.is_some_and(|other| other.inside(k, x) <= slack)
        })
    }

    /// Whether no triangle at a corner is nearer than the corner is to what is `from` it (m).
    fn is_corner_nearest(&self, placed: &[Shape], corner: u32, from: DVec3, slack: f64) -> bool {
        self.at_corner.of(corner).iter().all(|&o| {
            let k = place_of(&self.corners[o as usize], corner);
            as_triangle(&placed[o as usize]).is_some_and(|other| {
                // To the next corner, and to the one before.
                let last = (k + 2) % 3;
                other.along(k).dot(from) <= slack * other.length[k]
                    && -other.along(last).dot(from) <= slack * other.length[last]
            })
        })
    }
}

fn place_of(all: &[u32; 3], one: u32) -> usize {
    all.iter().position(|&e| e == one).unwrap_or(0)
}

fn as_triangle(shape: &Shape) -> Option<&Triangle> {
    match shape {
        Shape::Triangle(triangle) => Some(triangle),
        _ => None,
    }
}

fn triangle(points: &[DVec3], named: &[u32; 3]) -> Result<Triangle, String> {
    let mut corners = [DVec3::ZERO; 3];
    for (corner, &k) in corners.iter_mut().zip(named) {
        let point = points.get(k as usize);
        *corner = *point.ok_or_else(|| format!("names point {k}; there are {}", points.len()))?;
    }
    let triangle = Triangle::new(corners);
    let longest = triangle.length.into_iter().fold(0.0, f64::max);
    if !(triangle.normal.is_finite() && triangle.across().length() > THIN * longest * longest) {
        return Err("has corners on one line, or no numbers".to_owned());
    }
    Ok(triangle)
}

/// A number for each pair of points that an edge joins, by triangle, and these pairs.
fn number_edges(corners: &[[u32; 3]]) -> (Vec<[u32; 3]>, Vec<[u32; 2]>) {
    let (mut numbers, mut ends) = (HashMap::new(), Vec::new());
    let edges = corners.iter().map(|c| {
        [0, 1, 2].map(|k| {
            let (a, b) = (c[k].min(c[(k + 1) % 3]), c[k].max(c[(k + 1) % 3]));
            *numbers.entry((a, b)).or_insert_with(|| {
                ends.push([a, b]);
                ends.len() as u32 - 1
            })
        })
    });
    let edges = edges.collect();
    (edges, ends)
}
