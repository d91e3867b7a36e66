//! Compares two messages field by field, by the byte table of their recording.

use crate::byte_values::{Number, number};
use messages::{ByteField, ByteTable, Envelope};
use recording::kind_bytes;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Fields that hold times of publication. They differ from run to run.
const CLOCK_FIELDS: [&str; 2] = ["born_nanos", "sent_nanos"];

/// A field and its tolerance.
pub struct FieldRule {
    name: String,
    field: ByteField,
    bytes: usize,
    tolerance: f64,
}

/// The first element of a field that differs.
struct FieldDifference {
    index: usize,
    a: Number,
    b: Number,
    /// Largest distance of all elements.
    largest: f64,
}

impl FieldRule {
    /// Rules for envelope, header and row. Field names of the first two start with `envelope.` and `header.`.
    pub fn from_table(table: &ByteTable, tolerance: impl Fn(&str) -> f64) -> [Vec<Self>; 3] {
        [("envelope.", &table.envelope), ("header.", &table.header), ("", &table.row)].map(|(part, fields)| {
            let compared = fields.iter().filter(|field| !CLOCK_FIELDS.contains(&field.name.as_str()));
            compared
                .map(|field| {
                    let name = format!("{part}{}", field.name);
                    let bytes = kind_bytes(&field.kind).unwrap_or(1);
                    Self { tolerance: tolerance(&name), name, field: field.clone(), bytes }
                })
                .collect()
        })
    }

    /// The first element that differs by more than the tolerance.
    fn difference(&self, a: &[u8], b: &[u8]) -> Option<FieldDifference> {
        let mut first = None;
        let mut largest = 0.0_f64;
        for index in 0..self.field.count {
            let at = self.field.offset + index * self.bytes;
            let a = a.get(at..at + self.bytes)?;
            let b = b.get(at..at + self.bytes)?;
            if a == b {
                continue;
            }
            let a = number(&self.field.kind, a).ok()?;
            let b = number(&self.field.kind, b).ok()?;
            let distance = a.distance(b);
            // Without a tolerance the bits are compared: -0.0 differs from 0.0. NaN exceeds every tolerance.
            if self.tolerance > 0.0 && distance <= self.tolerance {
                continue;
            }
            largest = if distance.is_nan() { distance } else { largest.max(distance) };
            first.get_or_insert((index, a, b));
        }
        first.map(|(index, a, b)| FieldDifference { index, a, b, largest })
    }
}

/// Number of rows that differ, and the largest difference, by field.
#[derive(Default, Serialize)]
pub struct Differences(BTreeMap<String, (u64, f64)>);

impl Differences {
    /// Compares two messages. Returns a description of the first difference, if there is one.
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
            let Some(FieldDifference { index, a, b, largest }) = rule.difference(a, b) else { continue };
            first.get_or_insert_with(|| {
                let element = if rule.field.count > 1 { format!("[{index}]") } else { String::new() };
                format!("{place}{}{element}: {a} in a, {b} in b, difference {}", rule.name, a.distance(b))
            });
            let (n_rows, most) = self.0.entry(rule.name.clone()).or_default();
            *n_rows += 1;
            *most = if largest.is_nan() { largest } else { most.max(largest) };
        }
    }

    /// A text table; empty if there are no differences.
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
    use messages::{ImuRow, ImuTopic, NoHeader};

    fn message(rows: &[ImuRow], sent_nanos: u64) -> Vec<u8> {
        let envelope = [Envelope { sent_nanos, len: rows.len() as u32, ..Envelope::default() }];
        let header = [NoHeader::default()];
        [bytes_from_rows(&envelope), bytes_from_rows(&header), bytes_from_rows(rows)].concat()
    }

    #[test]
    fn first_and_largest_difference_are_reported_by_field() {
        let table = ByteTable::of::<ImuTopic>();
        let rules = FieldRule::from_table(&table, |field| if field == "angular_rate" { 0.5 } else { 0.0 });
        let a = [ImuRow { stamp: -5, ..ImuRow::default() }; 4];
        let mut b = a;
        (b[1].acceleration[2], b[3].acceleration[0]) = (0.25, -2.0);
        b[3].stamp = 7;
        b[2].angular_rate[0] = 0.5;
        let mut differences = Differences::default();
        let first = differences.add(&rules, &table, &message(&a, 1), &message(&b, 2)).expect("differs");
        assert_eq!(first, "row 1 acceleration[2]: 0 in a, 0.25 in b, difference 0.25");
        assert_eq!(differences.0["acceleration"], (2, 2.0));
        assert_eq!(differences.0["stamp"], (1, 12.0));
        assert_eq!(differences.0.len(), 2, "differences within the tolerance and times of publication are ignored");
        assert_eq!(differences.add(&rules, &table, &message(&a, 1), &message(&a, 2)), None);
        let shorter = differences.add(&rules, &table, &message(&a, 1), &message(&a[..3], 1)).expect("differs");
        assert_eq!(shorter, "envelope.len: 4 in a, 3 in b, difference 1");
    }
}
