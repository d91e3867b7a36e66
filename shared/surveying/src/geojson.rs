//! Positions and geometries of GeoJSON (RFC 7946). Geometries that cross the antimeridian are cut there (section 3.1.9).

use geometry::Geodetic;
use serde_json::{Value, json};

/// Longitude, latitude, height above the ellipsoid. The eighth decimal of a degree is about 1 mm.
pub(crate) fn position(place: &Geodetic) -> Value {
    json!([rounded(place.longitude_deg, 1e8), rounded(place.latitude_deg, 1e8), rounded(place.altitude_m, 1e2)])
}

/// A value rounded to a multiple of `1 / unit`.
pub(crate) fn rounded(value: f64, unit: f64) -> f64 {
    (value * unit).round() / unit
}

/// A longitude plus a multiple of 360 degrees, at most 180 degrees from another longitude.
pub(crate) fn unwrapped(longitude_deg: f64, near_deg: f64) -> f64 {
    let off = longitude_deg - near_deg;
    // Without a jump, the longitude keeps its bits.
    if off.abs() <= 180.0 { longitude_deg } else { longitude_deg - 360.0_f64.copysign(off) }
}

/// A `LineString`, or a `MultiLineString` if the line crosses the antimeridian.
pub(crate) fn line(places: &[Geodetic]) -> Value {
    let mut parts: Vec<Vec<Geodetic>> = Vec::new();
    let mut part: Vec<Geodetic> = Vec::new();
    for place in places {
        let jump = part.last().copied().filter(|last| (place.longitude_deg - last.longitude_deg).abs() > 180.0);
        if let Some(last) = jump {
            let edge = 180.0_f64.copysign(last.longitude_deg);
            let longitude_deg = unwrapped(place.longitude_deg, last.longitude_deg);
            let end = between(&last, &Geodetic { longitude_deg, ..*place }, edge);
            let start = Geodetic { longitude_deg: -edge, ..end };
            part.extend((end != last).then_some(end));
            parts.push(std::mem::take(&mut part));
            part.extend((start != *place).then_some(start));
        }
        part.push(*place);
    }
    if parts.is_empty() {
        return json!({ "type": "LineString", "coordinates": positions(&part) });
    }
    parts.push(part);
    // A line that ends on the antimeridian has a part of one position.
    parts.retain(|part| part.len() > 1);
    match parts.as_slice() {
        [] => json!({ "type": "LineString", "coordinates": positions(places) }),
        [part] => json!({ "type": "LineString", "coordinates": positions(part) }),
        _ => {
            let parts: Vec<Vec<Value>> = parts.iter().map(|part| positions(part)).collect();
            json!({ "type": "MultiLineString", "coordinates": parts })
        }
    }
}

/// A `Polygon` with this closed, convex, counter-clockwise ring, or a `MultiPolygon` if it crosses the antimeridian. `ring`
/// has each corner once.
pub(crate) fn convex_polygon(ring: &[Geodetic]) -> Value {
    let Some(first) = ring.first() else { return Value::Null };
    let near = first.longitude_deg;
    let ring: Vec<Geodetic> =
        ring.iter().map(|place| Geodetic { longitude_deg: unwrapped(place.longitude_deg, near), ..*place }).collect();
    let crossed = [-180.0, 180.0].into_iter().find(|edge| {
        ring.iter().any(|place| place.longitude_deg < *edge) && ring.iter().any(|place| place.longitude_deg > *edge)
    });
    let Some(edge) = crossed else {
        let outside = ring.iter().any(|place| place.longitude_deg.abs() > 180.0);
        let shift = if outside { 360.0_f64.copysign(-near) } else { 0.0 };
        return json!({ "type": "Polygon", "coordinates": [closed(&ring, shift)] });
    };
    let west = half(&ring, edge, |longitude| longitude <= edge);
    let east = half(&ring, edge, |longitude| longitude >= edge);
    let [west_shift, east_shift] = if edge > 0.0 { [0.0, -360.0] } else { [360.0, 0.0] };
    json!({ "type": "MultiPolygon", "coordinates": [[closed(&west, west_shift)], [closed(&east, east_shift)]] })
}

/// The part of a convex ring on one side of a meridian.
fn half(ring: &[Geodetic], edge: f64, is_inside: impl Fn(f64) -> bool) -> Vec<Geodetic> {
    let mut part = Vec::new();
    for (place, next) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        let is_here = is_inside(place.longitude_deg);
        if is_here {
            part.push(*place);
        }
        // An end on the meridian itself belongs to both sides and needs no cut.
        let crosses = (place.longitude_deg - edge) * (next.longitude_deg - edge) < 0.0;
        if crosses {
            part.push(between(place, next, edge));
        }
    }
    part
}

/// The position where the straight line between two positions has this longitude.
fn between(from: &Geodetic, to: &Geodetic, longitude_deg: f64) -> Geodetic {
    let span = to.longitude_deg - from.longitude_deg;
    let share = if span == 0.0 { 0.0 } else { (longitude_deg - from.longitude_deg) / span };
    let at = |a: f64, b: f64| a + share * (b - a);
    Geodetic {
        latitude_deg: at(from.latitude_deg, to.latitude_deg),
        longitude_deg,
        altitude_m: at(from.altitude_m, to.altitude_m),
    }
}

fn positions(places: &[Geodetic]) -> Vec<Value> {
    places.iter().map(position).collect()
}

/// The positions of a ring, the first one again at the end.
fn closed(ring: &[Geodetic], shift_deg: f64) -> Vec<Value> {
    let shifted = ring.iter().chain(ring.first());
    shifted.map(|place| position(&Geodetic { longitude_deg: place.longitude_deg + shift_deg, ..*place })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(numbers: &[[f64; 3]]) -> Vec<Geodetic> {
        let place = |[lon, lat, altitude]: [f64; 3]| Geodetic::new(lat, lon, altitude).expect("a position");
        numbers.iter().copied().map(place).collect()
    }

    #[test]
    fn line_is_cut_where_it_crosses_the_antimeridian() {
        for (numbers, expected) in [
            (
                &[[2.0, 48.0, 1.0], [2.1, 48.1, 2.0]][..],
                json!({ "type": "LineString", "coordinates": [[2.0, 48.0, 1.0], [2.1, 48.1, 2.0]] }),
            ),
            (
                &[[179.0, 10.0, 0.0], [-179.0, 12.0, 2.0], [179.0, 14.0, 4.0]],
                json!({ "type": "MultiLineString", "coordinates": [
                    [[179.0, 10.0, 0.0], [180.0, 11.0, 1.0]],
                    [[-180.0, 11.0, 1.0], [-179.0, 12.0, 2.0], [-180.0, 13.0, 3.0]],
                    [[180.0, 13.0, 3.0], [179.0, 14.0, 4.0]],
                ] }),
            ),
            // Positions on the antimeridian itself.
            (
                &[[179.0, 10.0, 0.0], [180.0, 10.0, 0.0], [-179.0, 10.0, 0.0]],
                json!({ "type": "MultiLineString", "coordinates": [
                    [[179.0, 10.0, 0.0], [180.0, 10.0, 0.0]], [[-180.0, 10.0, 0.0], [-179.0, 10.0, 0.0]],
                ] }),
            ),
            (
                &[[-179.0, 10.0, 0.0], [-179.5, 10.0, 0.0], [180.0, 10.0, 0.0]],
                json!({ "type": "LineString", "coordinates": [
                    [-179.0, 10.0, 0.0], [-179.5, 10.0, 0.0], [-180.0, 10.0, 0.0],
                ] }),
            ),
            (&[[3.0, 4.0, 5.0]], json!({ "type": "LineString", "coordinates": [[3.0, 4.0, 5.0]] })),
            (&[], json!({ "type": "LineString", "coordinates": [] })),
        ] {
            assert_eq!(line(&places(numbers)), expected, "{numbers:?}");
        }
    }

    #[test]
    fn polygon_is_cut_where_it_crosses_the_antimeridian() {
        for (numbers, expected) in [
            (
                &[[179.0, 0.0, 1.0], [-179.0, 0.0, 1.0], [-179.0, 2.0, 1.0], [179.0, 2.0, 1.0]][..],
                json!({ "type": "MultiPolygon", "coordinates": [
                    [[[179.0, 0.0, 1.0], [180.0, 0.0, 1.0], [180.0, 2.0, 1.0], [179.0, 2.0, 1.0], [179.0, 0.0, 1.0]]],
                    [[[-180.0, 0.0, 1.0], [-179.0, 0.0, 1.0], [-179.0, 2.0, 1.0], [-180.0, 2.0, 1.0], [-180.0, 0.0, 1.0]]],
                ] }),
            ),
            (
                &[[-179.0, 0.0, 1.0], [-179.0, 2.0, 1.0], [179.0, 2.0, 1.0], [179.0, 0.0, 1.0]],
                json!({ "type": "MultiPolygon", "coordinates": [
                    [[[180.0, 2.0, 1.0], [179.0, 2.0, 1.0], [179.0, 0.0, 1.0], [180.0, 0.0, 1.0], [180.0, 2.0, 1.0]]],
                    [[[-179.0, 0.0, 1.0], [-179.0, 2.0, 1.0], [-180.0, 2.0, 1.0], [-180.0, 0.0, 1.0], [-179.0, 0.0, 1.0]]],
                ] }),
            ),
            // A side on the antimeridian: nothing to cut, and all longitudes on one side.
            (
                &[[180.0, 0.0, 1.0], [-179.0, 0.0, 1.0], [-179.0, 2.0, 1.0], [180.0, 2.0, 1.0]],
                json!({ "type": "Polygon", "coordinates": [[
                    [-180.0, 0.0, 1.0], [-179.0, 0.0, 1.0], [-179.0, 2.0, 1.0], [-180.0, 2.0, 1.0], [-180.0, 0.0, 1.0],
                ]] }),
            ),
            (
                &[[2.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 2.0, 1.0], [2.0, 2.0, 1.0]],
                json!({ "type": "Polygon", "coordinates": [[
                    [2.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 2.0, 1.0], [2.0, 2.0, 1.0], [2.0, 0.0, 1.0],
                ]] }),
            ),
        ] {
            assert_eq!(convex_polygon(&places(numbers)), expected, "{numbers:?}");
        }
    }
}
