//! Road with its paint, kerbs, sidewalks, the cross street, and the ground behind the houses.

use super::builder::{Builder, SurfaceId};
use super::street::Street;
use crate::material::Material;
use crate::noise::rough;
use crate::trace::Vec3;
use messages::ClassId;

/// Distance from the center line to the kerb, m: a lane of 3 m and parked cars of 2.2 m.
pub const KERB_T: f32 = 5.2;
/// To the facades, m.
pub const FACADE_T: f32 = 8.4;
/// Height of the kerb, m.
pub const KERB_H: f32 = 0.14;
/// How far the cross street reaches to either side, m.
pub const CROSS_REACH: f32 = 60.0;

/// Half the widths of a crossing road and of its space between the houses, m.
const CROSS_ROAD: f32 = 3.5;
/// See [`CROSS_ROAD`].
pub const CROSS_HALF: f32 = 6.5;

/// Length of the cells along the street, m. Lines and their dashes begin on cell edges.
const CELL: f32 = 0.5;

/// The ground's surfaces.
struct Looks {
    road: SurfaceId,
    paint: SurfaceId,
    kerb: SurfaceId,
    slab: SurfaceId,
}

/// The uneven ground of the whole street. `crossings` are the `x` of cross streets.
pub fn build(builder: &mut Builder, street: &Street, crossings: &[f32], seed: u64) {
    let looks = Looks {
        road: builder.surface(ClassId::Road, 0, Material::Asphalt),
        paint: builder.surface(ClassId::RoadLine, 0, Material::RoadPaint),
        kerb: builder.surface(ClassId::Sidewalk, 0, Material::Granite),
        slab: builder.surface(ClassId::Sidewalk, 0, Material::Slab),
    };
    let columns = columns();
    let n_rows = ((street.ends[1] - street.ends[0]) as f32 / CELL) as usize;
    for row in 0..n_rows {
        let x = street.ends[0] as f32 + row as f32 * CELL;
        for pair in columns.windows(2) {
            cell(builder, street, &looks, crossings, seed, x, [pair[0], pair[1]]);
        }
        kerbs(builder, street, &looks, crossings, seed, x);
    }
    for &x in crossings {
        cross_street(builder, street, &looks, seed, x);
    }
    backyards(builder, street);
}

/// Edges of the cells across the street: paint 12 cm wide in the middle, crosswalk bars and slabs of about half a metre.
fn columns() -> Vec<f32> {
    let mut columns = vec![-0.06_f32, 0.06];
    for i in 1..=16 {
        let t = i as f32 * 0.5;
        if (t - KERB_T).abs() > 0.3 {
            columns.extend([-t, t]);
        }
    }
    columns.extend([-KERB_T, KERB_T, -KERB_T - 0.15, KERB_T + 0.15, -FACADE_T - 0.6, FACADE_T + 0.6]);
    columns.sort_by(f32::total_cmp);
    columns
}

/// Height of the smooth, crowned road over the center line.
pub fn road_height(t: f32) -> f32 {
    -0.018 * t.abs().min(KERB_T)
}

/// Height of the smooth sidewalk over the center line.
pub fn walk_height(t: f32) -> f32 {
    road_height(t) + KERB_H + 0.01 * (t.abs() - KERB_T)
}

/// How far the ground is off its smooth shape: 3.6 cm from the deepest rut to the highest swell.
fn uneven(seed: u64, x: f32, t: f32) -> f32 {
    0.018 * rough(seed, x, t, 3.1, 0.9)
}

/// Height of the uneven ground over the center line.
pub fn height(crossings: &[f32], seed: u64, x: f32, t: f32) -> f32 {
    uneven(seed, x, t) + if on_sidewalk(crossings, x, t) { walk_height(t) } else { road_height(t) }
}

/// Whether the place is raised: beyond the kerb and not where a cross street opens.
pub fn on_sidewalk(crossings: &[f32], x: f32, t: f32) -> bool {
    t.abs() >= KERB_T && !crossings.iter().any(|c| (x - c).abs() < CROSS_ROAD)
}

fn cell(b: &mut Builder, street: &Street, looks: &Looks, crossings: &[f32], seed: u64, x: f32, [t0, t1]: [f32; 2]) {
    let middle = 0.5 * (t0 + t1);
    let raised = on_sidewalk(crossings, x + 0.5 * CELL, middle);
    let surface = if raised {
        if middle.abs() < KERB_T + 0.15 { looks.kerb } else { looks.slab }
    } else if is_painted(crossings, x, middle) {
        looks.paint
    } else {
        looks.road
    };
    // A cell is raised as a whole: its height on the kerb's edge is that of its own side.
    let h = |x: f32, t: f32| uneven(seed, x, t) + if raised { walk_height(t) } else { road_height(t) };
    let corner = |x: f32, t: f32| street.vertex(x, t, h(x, t));
    b.quad([corner(x, t0), corner(x + CELL, t0), corner(x + CELL, t1), corner(x, t1)], surface);
}

/// A dashed middle line (3 m in 6 m), and crosswalks before and after each crossing.
fn is_painted(crossings: &[f32], x: f32, t: f32) -> bool {
    let near = crossings.iter().map(|c| (x + 0.5 * CELL - c).abs()).fold(f32::INFINITY, f32::min);
    let crosswalk = (CROSS_ROAD + 0.5..CROSS_ROAD + 3.0).contains(&near);
    if crosswalk {
        return t.abs() < KERB_T && ((t + 10.0) / 0.5).floor().rem_euclid(2.0) < 0.5;
    }
    t.abs() < 0.06 && near > CROSS_HALF && x.rem_euclid(6.0) < 3.0
}

/// The upright faces of the kerbs, along the street and into the cross streets.
fn kerbs(b: &mut Builder, street: &Street, looks: &Looks, crossings: &[f32], seed: u64, x: f32) {
    for side in [-1.0_f32, 1.0] {
        let t = side * KERB_T;
        if !on_sidewalk(crossings, x + 0.5 * CELL, t) {
            continue;
        }
        let foot = |x: f32| uneven(seed, x, t) + road_height(t);
        let corner = |x: f32, up: f32| street.vertex(x, t, foot(x) + up);
        let top = KERB_H;
        b.quad([corner(x, -0.02), corner(x + CELL, -0.02), corner(x + CELL, top), corner(x, top)], looks.kerb);
    }
    for &c in crossings {
        for edge in [c - CROSS_ROAD, c + CROSS_ROAD] {
            if !(x..x + CELL).contains(&edge) {
                continue;
            }
            for side in [-1.0_f32, 1.0] {
                let corner = |t: f32, up: f32| street.vertex(edge, side * t, -0.11 + up);
                let quad = [corner(KERB_T, 0.0), corner(FACADE_T, 0.0), corner(FACADE_T, 0.19), corner(KERB_T, 0.19)];
                b.quad(quad, looks.kerb);
            }
        }
    }
}

/// The arms of a cross street beyond the facades: road between two sidewalks, in cells of 1 m.
fn cross_street(b: &mut Builder, street: &Street, looks: &Looks, seed: u64, x0: f32) {
    let edges = [-CROSS_HALF, -5.0, -CROSS_ROAD, -2.0, -0.06, 0.06, 2.0, CROSS_ROAD, 5.0, CROSS_HALF];
    for side in [-1.0_f32, 1.0] {
        for step in 0..(CROSS_REACH - FACADE_T) as usize {
            let (t0, t1) = (FACADE_T + step as f32 + 0.5, FACADE_T + step as f32 + 1.5);
            for pair in edges.windows(2) {
                let middle = 0.5 * (pair[0] + pair[1]);
                let raised = middle.abs() > CROSS_ROAD;
                let surface = match (raised, middle.abs() < 0.06 && step % 6 < 3) {
                    (true, _) => looks.slab,
                    (false, true) => looks.paint,
                    (false, false) => looks.road,
                };
                let corner = |dx: f32, t: f32| -> Vec3 {
                    let (x, t) = (x0 + dx, side * t);
                    let up = if raised { KERB_H + 0.02 } else { 0.0 };
                    street.vertex(x, t, uneven(seed, x, t) + road_height(KERB_T) + up)
                };
                b.quad([corner(pair[0], t0), corner(pair[1], t0), corner(pair[1], t1), corner(pair[0], t1)], surface);
            }
        }
    }
}

/// Grass under and behind all: what is seen through gaps, and never a hole.
fn backyards(b: &mut Builder, street: &Street) {
    let grass = b.surface(ClassId::Terrain, 0, Material::Grass);
    let (from, to) = (street.ends[0] as f32 - 40.0, street.ends[1] as f32 + 40.0);
    let n = ((to - from) / 5.0).ceil() as usize;
    for row in 0..n {
        let (x0, x1) = (from + row as f32 * 5.0, from + (row + 1) as f32 * 5.0);
        for pair in [-110.0_f32, -70.0, -40.0, -20.0, 0.0, 20.0, 40.0, 70.0, 110.0].windows(2) {
            let corner = |x: f32, t: f32| street.vertex(x, t, -0.35);
            b.quad([corner(x0, pair[0]), corner(x1, pair[0]), corner(x1, pair[1]), corner(x0, pair[1])], grass);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sidewalks_are_raised_and_open_at_crossings() {
        let crossings = [50.0];
        let step = height(&crossings, 1, 20.0, KERB_T + 0.01) - height(&crossings, 1, 20.0, KERB_T - 0.01);
        assert!((step - KERB_H).abs() < 0.01, "{step}");
        assert!(!on_sidewalk(&crossings, 50.0, 7.0) && on_sidewalk(&crossings, 60.0, 7.0));
    }

    #[test]
    fn lines_are_dashed_and_crosswalks_striped() {
        assert!(is_painted(&[50.0], 12.5, 0.0) && !is_painted(&[50.0], 15.5, 0.0) && !is_painted(&[50.0], 12.5, 1.0));
        let bars = [-1.75_f32, -1.25, -0.75, -0.25].map(|t| is_painted(&[50.0], 45.0, t));
        assert_eq!(bars, [true, false, true, false].map(|b| b == bars[0]));
    }
}
