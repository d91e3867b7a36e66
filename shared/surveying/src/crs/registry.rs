//! The tables of the EPSG registry that `registry/make.py` writes. `registry/README.md` describes their columns.

use super::area::Area;

/// Version of the EPSG registry in the tables.
pub const EPSG_VERSION: &str = "11.022";

const SYSTEMS: &str = include_str!("registry/systems.tsv");
const DATUMS: &str = include_str!("registry/datums.tsv");
const GRIDS: &str = include_str!("registry/grids.tsv");
const HEIGHTS: &str = include_str!("registry/heights.tsv");
const COMPOUNDS: &str = include_str!("registry/compounds.tsv");
const REFUSED: &str = include_str!("registry/refused.tsv");

/// A projected system of the table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct System {
    pub(super) epsg: u32,
    pub(super) name: &'static str,
    /// Number of the geographic system of its datum.
    pub(super) datum: u32,
    /// Key of the projection method.
    pub(super) method: &'static str,
    /// Parameters of the method as decimal numbers: degrees, m, or without unit.
    pub(super) values: Vec<&'static str>,
    /// Axes in WKT 1: `EN`, `NE`, or empty for polar systems, whose axes WKT 1 cannot express.
    pub(super) axes: &'static str,
    pub(super) area: Area,
}

/// A geographic system of the table, and how it follows from positions of a receiver.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Datum {
    pub(super) kind: DatumKind,
    /// Semi-major axis in m and inverse flattening as decimal numbers.
    pub(super) ellipsoid: [&'static str; 2],
    /// `GEOGCS` in WKT 1.
    pub(super) wkt: &'static str,
}

/// How a datum follows from positions of a receiver.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DatumKind {
    /// Receivers with corrections in this datum give it directly.
    Satellite,
    /// A Helmert transformation that defines the datum: parameters to ETRS89, see `geometry::Projection::shifted`.
    Helmert([f64; 7]),
    /// Grids of shifts.
    Grid,
}

/// A grid of shifts between a datum and positions of a receiver.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    /// Whether the shifts lead from the datum to positions of a receiver, not back.
    pub(super) is_to_satellite: bool,
    /// Accuracy by the registry, m, as a decimal number.
    pub(super) accuracy_m: &'static str,
    /// Name of the file.
    pub(super) name: &'static str,
    /// Area in words.
    pub(super) area: &'static str,
}

/// A vertical system of the table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Height {
    pub(super) epsg: u32,
    pub(super) name: &'static str,
    pub(super) datum: &'static str,
    pub(super) datum_epsg: &'static str,
    /// Names of its geoid grids.
    pub(super) grids: Vec<&'static str>,
    pub(super) area: Area,
}

/// A projected and a vertical system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Compound {
    pub(super) horizontal: u32,
    pub(super) height: u32,
}

/// Columns of the line that starts with a number.
fn line<const N: usize>(table: &'static str, number: u32) -> Option<[&'static str; N]> {
    let number = number.to_string();
    columns(table.lines().find(|line| line.split('\t').next() == Some(&number))?)
}

fn columns<const N: usize>(line: &'static str) -> Option<[&'static str; N]> {
    let columns: Vec<&str> = line.split('\t').collect();
    columns.try_into().ok()
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Result<Vec<f64>, _> = text.split(' ').map(str::parse).collect();
    numbers.ok()?.try_into().ok()
}

fn parsed_system([epsg, name, datum, method, values, axes, area]: [&'static str; 7]) -> Option<System> {
    let epsg = epsg.parse().ok()?;
    let area = Area::new(epsg, numbers(area)?);
    Some(System { epsg, name, datum: datum.parse().ok()?, method, values: values.split(' ').collect(), axes, area })
}

/// A projected system that the project converts to.
pub(super) fn system(epsg: u32) -> Option<System> {
    parsed_system(line(SYSTEMS, epsg)?)
}

/// All projected systems, by number.
pub(super) fn systems() -> impl Iterator<Item = System> {
    SYSTEMS.lines().filter_map(|line| parsed_system(columns(line)?))
}

/// The geographic system of a datum.
pub(super) fn datum(epsg: u32) -> Option<Datum> {
    let [_, kind, shift, a, rf, wkt] = line(DATUMS, epsg)?;
    let kind = match kind {
        "satellite" => DatumKind::Satellite,
        "grid" => DatumKind::Grid,
        _ => DatumKind::Helmert(numbers(shift)?),
    };
    Some(Datum { kind, ellipsoid: [a, rf], wkt })
}

/// The grids of a datum, the most accurate one first.
pub(super) fn grids(datum: u32) -> Vec<Grid> {
    let datum = datum.to_string();
    let rows = GRIDS.lines().filter_map(columns);
    rows.filter(|[number, ..]: &[&str; 6]| *number == datum)
        .map(|[_, direction, accuracy_m, name, _, area]| Grid {
            is_to_satellite: direction == "to_satellite",
            accuracy_m,
            name,
            area,
        })
        .collect()
}

/// A vertical system.
pub(super) fn height(epsg: u32) -> Option<Height> {
    let [_, name, datum, datum_epsg, grids, area] = line(HEIGHTS, epsg)?;
    let grids = grids.split(' ').filter(|grid| !grid.is_empty()).collect();
    Some(Height { epsg, name, datum, datum_epsg, grids, area: Area::new(0, numbers(area)?) })
}

/// The parts of a compound system.
pub(super) fn compound(epsg: u32) -> Option<Compound> {
    let [_, horizontal, height] = line(COMPOUNDS, epsg)?;
    Some(Compound { horizontal: horizontal.parse().ok()?, height: height.parse().ok()? })
}

/// Name of a projected system that the project does not convert to, and the reason in words.
pub(super) fn refusal(epsg: u32) -> Option<(&'static str, String)> {
    let [_, name, reason] = line(REFUSED, epsg)?;
    let (kind, detail) = reason.split_once(' ').unwrap_or((reason, ""));
    let reason = match kind {
        "unit" => format!("its coordinates are in {detail}, deliveries are in metres"),
        "axes" => "its coordinates count to the west or south".to_owned(),
        "meridian" => format!("its longitudes count from {detail}"),
        "method" => format!("its projection method is {detail}"),
        "deprecated" if detail.is_empty() => "the registry has withdrawn it".to_owned(),
        "deprecated" => format!("the registry replaces it by EPSG:{}", detail.replace(' ', " or EPSG:")),
        _ => format!("the registry has no single transformation to its datum, {detail}, that is accurate to 1 cm"),
    };
    Some((name, reason))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::method::method;

    #[test]
    fn every_line_of_the_tables_is_read() {
        assert_eq!(systems().count(), SYSTEMS.lines().count());
        assert!(SYSTEMS.lines().count() > 2500);
        for system in systems() {
            let datum = datum(system.datum).expect("has a datum");
            let method = method(system.method).expect("has a method");
            assert_eq!(system.values.len(), method.parameters.len(), "EPSG:{}", system.epsg);
            assert_eq!(datum.kind == DatumKind::Grid, !grids(system.datum).is_empty(), "EPSG:{}", system.epsg);
            assert_eq!(refusal(system.epsg), None, "EPSG:{}", system.epsg);
        }
        let number =
            |line: &'static str| -> u32 { line.split('\t').next().expect("has one").parse().expect("a number") };
        assert!(HEIGHTS.lines().all(|line| height(number(line)).is_some()));
        for parts in COMPOUNDS.lines().map(|line| compound(number(line)).expect("is one")) {
            assert!(system(parts.horizontal).is_some() && height(parts.height).is_some(), "{parts:?}");
        }
        assert!(REFUSED.lines().all(|line| refusal(number(line)).is_some()));
        let n_grids: usize = DATUMS.lines().map(|line| grids(number(line)).len()).sum();
        assert_eq!(n_grids, GRIDS.lines().count());
    }
}
