//! Two messages field by field, by the byte table that their recording carries.

use formats::recording::kind_bytes;
use messages::{ByteField, ByteTable, Envelope};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Fields that tell of the clock and not of the drive.
const CLOCK: [&str; 2] = ["born_nanos", "sent_nanos"];

/// One number as it stands in a message.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    Whole(i128),
    Float(f64),
}

impl Number {
    fn read(kind: &str, bytes: &[u8]) -> Option<Self> {
        let mut all = [0; 8];
        all.get_mut(..bytes.len())?.copy_from_slice(bytes);
        let word = u64::from_le_bytes(all);
        let unused = 64 - 8 * bytes.len() as u32;
        Some(match kind {
            "f32" => Self::Float(f64::from(f32::from_bits(word as u32))),
            "f64" => Self::Float(f64::from_bits(word)),
            _ if kind.starts_with('i') => Self::Whole(i128::from((word << unused).cast_signed() >> unused)),
            _ => Self::Whole(i128::from(word)),
        })
    }

    fn distance(self, other: Self) -> f64 {
        match (self, other) {
            (Self::Whole(a), Self::Whole(b)) => (a - b).unsigned_abs() as f64,
            (Self::Float(a), Self::Float(b)) => (a - b).abs(),
            _ => f64::NAN,
        }
    }
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Whole(number) => write!(f, "{number}"),
            Self::Float(number) => write!(f, "{number:?}"),
        }
    }
}

/// A field and how much of a difference does not count.
pub struct FieldRule {
    name: String,
    field: ByteField,
    bytes: usize,
    tolerance: f64,
}

impl FieldRule {
    /// Rules of envelope, header and row. Names of the first two are `envelope.…` and `header.…`.
    pub fn of_table(table: &ByteTable, tolerance: impl Fn(&str) -> f64) -> [Vec<Self>; 3] {
        [("envelope.", &table.envelope), ("header.", &table.header), ("", &table.row)].map(|(part, fields)| {
            let counted = fields.iter().filter(|field| !CLOCK.contains(&field.name.as_str()));
            counted
                .map(|field| {
                    let name = format!("{part}{}", field.name);
                    let bytes = kind_bytes(&field.kind).unwrap_or(1);
                    Self { tolerance: tolerance(&name), name, field: field.clone(), bytes }
                })
                .collect()
        })
    }

    /// The first number that differs by more than the tolerance: which, both values; and the largest distance.
    fn difference(&self, a: &[u8], b: &[u8]) -> Option<(usize, Number, Number, f64)> {
        let mut first = None;
        let mut largest = 0.0_f64;
        for index in 0..self.field.count {
            let at = self.field.offset + index * self.bytes;
            let (a, b) = (a.get(at..at + self.bytes)?, b.get(at..at + self.bytes)?);
            if a == b {
                continue;
            }
            let (a, b) = (Number::read(&self.field.kind, a)?, Number::read(&self.field.kind, b)?);
            let distance = a.distance(b);
            // Without a tolerance the bits count: -0.0 is not 0.0. Not a number is beyond every tolerance.
            if self.tolerance > 0.0 && distance <= self.tolerance {
                continue;
            }
            largest = if distance.is_nan() { distance } else { largest.max(distance) };
            first.get_or_insert((index, a, b));
        }
        first.map(|(index, a, b)| (index, a, b, largest))
    }
}

/// By field: how many rows differ, and by how much at most.
#[derive(Default)]
pub struct Differences(BTreeMap<String, (u64, f64)>);

impl Differences {
    /// Takes in two messages; the first difference in words, if there is one.
    pub fn add(&mut self, rules: &[Vec<FieldRule>; 3], table: &ByteTable, a: &[u8], b: &[u8]) -> Option<String> {
        if a == b {
            return None;
        }
        let envelope = size_of::<Envelope>();
        let rows_at = envelope + table.header_bytes;
        let [envelope_rules, header_rules, row_rules] = rules;
        let mut first = None;
        self.add_part(envelope_rules, &a[..envelope], &b[..envelope], "", &mut first);
        self.add_part(header_rules, &a[envelope..rows_at], &b[envelope..rows_at], "", &mut first);
        let rows = |bytes| <[u8]>::chunks_exact(bytes, table.row_bytes);
        for (row, (a, b)) in rows(&a[rows_at..]).zip(rows(&b[rows_at..])).enumerate() {
            if a != b {
                self.add_part(row_rules, a, b, &format!("row {row} "), &mut first);
            }
        }
        first
    }

    fn add_part(&mut self, rules: &[FieldRule], a: &[u8], b: &[u8], place: &str, first: &mut Option<String>) {
        for rule in rules {
            let Some((index, a, b, largest)) = rule.difference(a, b) else { continue };
            first.get_or_insert_with(|| {
                let element = if rule.field.count > 1 { format!("[{index}]") } else { String::new() };
                format!("{place}{}{element}: {a} in a, {b} in b, difference {}", rule.name, a.distance(b))
            });
            let (n_rows, most) = self.0.entry(rule.name.clone()).or_default();
            *n_rows += 1;
            *most = if largest.is_nan() { largest } else { most.max(largest) };
        }
    }

    /// For people; empty if there are none.
    pub fn table(&self) -> String {
        let mut text = String::new();
        let width = self.0.keys().map(String::len).max().unwrap_or_default().max(5);
        if !self.0.is_empty() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "  {:width$}  {:>14}  largest difference", "field", "rows different");
        }
        for (name, (n_rows, largest)) in &self.0 {
            let _ = writeln!(text, "  {name:width$}  {n_rows:>14}  {largest}");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::pod::bytes_from_rows;
    use messages::{Imu, ImuRow, NoHeader};

    fn message(rows: &[ImuRow], sent_nanos: u64) -> Vec<u8> {
        let envelope = [Envelope { sent_nanos, len: rows.len() as u32, ..Envelope::default() }];
        let header = [NoHeader::default()];
        [bytes_from_rows(&envelope), bytes_from_rows(&header), bytes_from_rows(rows)].concat()
    }

    #[test]
    fn the_first_difference_and_the_largest_are_told_by_field() {
        let table = ByteTable::of::<Imu>();
        let rules = FieldRule::of_table(&table, |field| if field == "angular_rate" { 0.5 } else { 0.0 });
        let a = [ImuRow { stamp: -5, ..ImuRow::default() }; 4];
        let mut b = a;
        (b[1].acceleration[2], b[3].acceleration[0]) = (0.25, -2.0);
        b[3].stamp = 7;
        b[2].angular_rate[0] = 0.5;
        let mut differences = Differences::default();
        let first = differences.add(&rules, &table, &message(&a, 1), &message(&b, 2)).expect("differs");
        assert_eq!(first, "row 1 acceleration[2]: 0.0 in a, 0.25 in b, difference 0.25");
        assert_eq!(differences.0["acceleration"], (2, 2.0));
        assert_eq!(differences.0["stamp"], (1, 12.0));
        assert_eq!(differences.0.len(), 2, "the tolerance and the clock count for nothing");
        assert_eq!(differences.add(&rules, &table, &message(&a, 1), &message(&a, 2)), None);
        let shorter = differences.add(&rules, &table, &message(&a, 1), &message(&a[..3], 1)).expect("differs");
        assert_eq!(shorter, "envelope.len: 4 in a, 3 in b, difference 1");
    }

    #[test]
    fn numbers_of_all_kinds_are_read() {
        for (kind, bytes, value) in [
            ("u8", &[200_u8][..], Number::Whole(200)),
            ("i8", &[200], Number::Whole(-56)),
            ("i16", &[0xfe, 0xff], Number::Whole(-2)),
            ("u64", &[255; 8], Number::Whole(i128::from(u64::MAX))),
            ("i64", &[255; 8], Number::Whole(-1)),
            ("f32", &[0, 0, 0x80, 0x3f], Number::Float(1.0)),
        ] {
            assert_eq!(Number::read(kind, bytes), Some(value), "{kind}");
        }
    }
}
