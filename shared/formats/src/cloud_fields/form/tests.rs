//! Forms of recordings of several drivers.

use super::super::{Column, PointFlags, ValueType};
use super::*;

const STAMP: i64 = 1_700_000_000_000_000_000;

/// A revolution of 16 beams with times from `first` over `span`.
fn cloud(name: &str, first: f64, span: f64) -> RawCloud {
    let n = 16 * 100;
    let position = |k: usize| {
        let elevation = (2.0 * (k % 16) as f64 - 15.0).to_radians();
        let azimuth = k as f64 / n as f64 * std::f64::consts::TAU;
        [20.0 * elevation.cos() * azimuth.cos(), 20.0 * elevation.cos() * azimuth.sin(), 20.0 * elevation.sin()]
    };
    let column = |name: &str, value_type, values| Some(Column { name: name.to_owned(), value_type, values });
    RawCloud {
        positions: (0..n).map(position).collect(),
        position_type: ValueType::F32,
        intensities: None,
        beams: column("ring", ValueType::U16, (0..n).map(|k| (k % 16) as f64).collect()),
        times: column(name, ValueType::F64, (0..n).map(|k| first + span * k as f64 / n as f64).collect()),
        viewpoint: None,
        flags: PointFlags::default(),
    }
}

fn form(clouds: &[RawCloud], stamp: i64) -> CloudForm {
    let mut builder = FormBuilder::for_drive(Some(0.1), Some(16));
    for (index, cloud) in clouds.iter().enumerate() {
        builder.add(cloud, Some(stamp + index as i64 * 100_000_000)).expect("is a sweep");
    }
    builder.finish()
}

/// Offset of the last point, ns, and correction of the stamps, ms.
fn last(name: &str, first: f64, span: f64) -> (u32, i64) {
    let next = if first > 1e3 { first + 0.1 } else { first };
    let clouds = [cloud(name, first, span), cloud(name, next, span)];
    let form = form(&clouds, STAMP);
    let fired = form.fired(&clouds[0], STAMP).expect("fits");
    assert!(fired.has_rings && fired.points[15].ring == 15);
    (fired.points.last().expect("is there").offset_nanos, form.shift_nanos() / 1_000_000)
}

#[test]
fn units_of_a_drive_are_determined_by_the_span() {
    let part = 1599.0 / 1600.0;
    for (name, first, span, nanos, shift) in [
        ("t", 0.0, 1e8, 1e8 * part, 0),
        ("t", 0.0, 1e5, 1e8 * part, 0),
        ("t", 0.0, 0.1, 1e8 * part, 0),
        ("time", 0.0, 1e5, 1e8 * part, 0),
        ("offset_time", 0.0, 1e8, 1e8 * part, 0),
        // A part of a sweep in the documented unit.
        ("t", 0.0, 400_000.0, 400_000.0 * part, 0),
        // A stamp at the end of the sweep, which then begins 100 ms earlier.
        ("time", -0.1, 0.1, 1e8 * part, -100),
        ("timestamp", 1.7e9, 0.1, 1e8 * part, 0),
        ("timestamp", 1.7e9 - 0.0505, 0.1, 1e8 * part, -50),
        // A clock of its own.
        ("timestamp", 5000.0, 0.1, 1e8 * part, 0),
    ] {
        let (found, found_shift) = last(name, first, span);
        assert!(
            (f64::from(found) - nanos).abs() < 500.0 && found_shift == shift,
            "{name} {first} {span}: {found} {found_shift}"
        );
    }
}

#[test]
fn stamps_that_are_only_assumed_are_not_corrected() {
    let clouds = [cloud("time", -0.1, 0.1), cloud("time", -0.1, 0.1)];
    let form = form(&clouds, 0);
    let fired = form.fired(&clouds[0], 0).expect("fits");
    assert_eq!((form.shift_nanos(), fired.points[0].offset_nanos), (0, 0));
    assert!(form.report[0].contains("from the first point of each file"), "{:?}", form.report);
}

#[test]
fn beams_counted_from_the_highest_get_rings_from_the_lowest() {
    let mut falling = cloud("t", 0.0, 1e8);
    if let Some(column) = &mut falling.beams {
        column.values.iter_mut().for_each(|beam| *beam = 15.0 - *beam);
    }
    let form = form(&[falling.clone()], STAMP);
    assert_eq!(form.fired(&falling, STAMP).expect("fits").points[15].ring, 15);
}

#[test]
fn missing_returns_have_neither_times_nor_rings() {
    let mut organized = cloud("timestamp", 1.7e9, 0.1);
    for k in (0..1600).step_by(7) {
        organized.positions[k] = [f64::NAN; 3];
        for column in [&mut organized.times, &mut organized.beams].into_iter().flatten() {
            column.values[k] = if k % 2 == 0 { 0.0 } else { f64::NAN };
        }
    }
    let form = form(&[organized.clone()], STAMP);
    let fired = form.fired(&organized, STAMP).expect("fits");
    let last = fired.points.last().expect("is there");
    assert!(fired.has_times && fired.points[0].offset_nanos == 0 && last.offset_nanos > 99_000_000, "{last:?}");
}

#[test]
fn origin_of_map_coordinates_is_kept_and_precision_too() {
    let mut on_map = cloud("t", 0.0, 1e8);
    on_map.position_type = ValueType::F64;
    for position in &mut on_map.positions {
        position[0] += 452_150.0;
        position[1] += 5_410_700.0;
    }
    let form = form(&[on_map.clone()], STAMP);
    assert_eq!(form.origin, Some(MapOrigin([452_150, 5_410_700, 0])));
    let plain = cloud("t", 0.0, 1e8);
    let fired = form.fired(&on_map, STAMP).expect("fits");
    for (found, [x, y, _]) in fired.points.iter().zip(&plain.positions) {
        assert!((f64::from(found.point.x) - x).abs() < 1e-5 && (f64::from(found.point.y) - y).abs() < 1e-5);
    }
    let in_sensor = CloudForm { origin: None, ..form };
    assert_eq!(in_sensor.fired(&on_map, STAMP), Err(FieldFault::OtherFrame));
}
