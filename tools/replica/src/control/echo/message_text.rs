//! Messages as text, JSON or CSV.

use crate::byte_values::{Number, numbers};
use ipc::Observed;
use messages::{ByteField, ByteTable, Envelope};
use std::fmt::Write;

/// Header fields that fit a screen; the header of a submap has thousands.
const MAX_HEADER_FIELDS: usize = 24;
/// Numbers of an array that fit a line.
const MAX_NUMBERS: usize = 8;

/// Format of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text for reading.
    Text,
    /// JSON, one object per line.
    Json,
    /// CSV, one line per row.
    Csv,
}

/// Formats the messages of one topic.
pub struct MessageText {
    table: ByteTable,
    max_rows: usize,
    format: Format,
}

/// The parts of a message that are printed, decoded.
struct Parts<'a> {
    envelope: &'a Envelope,
    missed: u64,
    header: Vec<(&'a str, Vec<Number>)>,
    rows: Vec<Vec<(&'a str, Vec<Number>)>>,
}

/// The topic has no such field.
#[derive(Debug, thiserror::Error)]
#[error("topic {topic} has no field {name}; its fields are {}", known.join(", "))]
pub struct UnknownField {
    topic: String,
    name: String,
    known: Vec<String>,
}

impl MessageText {
    /// Selects the fields called `names`, or all fields if there are no names.
    pub fn new(mut table: ByteTable, names: &[String], max_rows: usize, format: Format) -> Result<Self, UnknownField> {
        let all: Vec<&str> = table.header.iter().chain(&table.row).map(|field| field.name.as_str()).collect();
        if let Some(unknown) = names.iter().find(|name| !all.contains(&name.as_str())) {
            let known = all.into_iter().map(str::to_owned).collect();
            return Err(UnknownField { topic: table.topic.clone(), name: unknown.clone(), known });
        }
        if !names.is_empty() {
            table.header.retain(|field| names.contains(&field.name));
            table.row.retain(|field| names.contains(&field.name));
        }
        Ok(Self { table, max_rows, format })
    }

    /// The line before the first message: column names for CSV, else nothing.
    pub fn title(&self) -> String {
        if self.format != Format::Csv {
            return String::new();
        }
        let columns = self.table.row.iter().flat_map(|field| {
            let name =
                |index: usize| if field.count == 1 { field.name.clone() } else { format!("{}.{index}", field.name) };
            (0..field.count).map(name)
        });
        let names: Vec<String> =
            ["seq", "stamp", "tick", "row"].map(str::to_owned).into_iter().chain(columns).collect();
        names.join(",") + "\n"
    }

    /// The text of one message, before which `missed` messages were missed.
    pub fn format(&self, message: &Observed, missed: u64) -> anyhow::Result<String> {
        self.write(message.envelope(), message.header(), message.rows(), missed)
    }

    fn write(&self, envelope: &Envelope, header: &[u8], rows: &[u8], missed: u64) -> anyhow::Result<String> {
        // A row without bytes has no fields.
        let rows = rows.chunks_exact(self.table.row_bytes.max(1)).take(self.max_rows);
        let parts = Parts {
            envelope,
            missed,
            header: if self.format == Format::Csv { Vec::new() } else { decode(&self.table.header, header)? },
            rows: rows.map(|row| decode(&self.table.row, row)).collect::<anyhow::Result<_>>()?,
        };
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = match self.format {
            Format::Text => text(&mut out, &self.table.topic, &parts),
            Format::Json => json(&mut out, &self.table.topic, &parts),
            Format::Csv => csv(&mut out, &parts),
        };
        Ok(out)
    }
}

fn decode<'a>(fields: &'a [ByteField], bytes: &[u8]) -> anyhow::Result<Vec<(&'a str, Vec<Number>)>> {
    fields.iter().map(|field| Ok((field.name.as_str(), numbers(field, bytes)?))).collect()
}

fn text(out: &mut String, topic: &str, parts: &Parts<'_>) -> std::fmt::Result {
    let envelope = parts.envelope;
    if parts.missed > 0 {
        writeln!(out, "({} messages missed)", parts.missed)?;
    }
    writeln!(
        out,
        "{topic}  seq {}  stamp {}  tick {}  rows {}",
        envelope.seq,
        in_seconds(envelope.stamp),
        envelope.tick,
        envelope.len
    )?;
    for (name, numbers) in parts.header.iter().take(MAX_HEADER_FIELDS) {
        writeln!(out, "  {name}: {}", line_of(numbers))?;
    }
    if parts.header.len() > MAX_HEADER_FIELDS {
        writeln!(out, "  … {} more fields; --json has all", parts.header.len() - MAX_HEADER_FIELDS)?;
    }
    let Some(first) = parts.rows.first() else { return Ok(()) };
    let names = first.iter().map(|(name, _)| (*name).to_owned()).collect();
    let lines = parts.rows.iter().map(|row| row.iter().map(|(_, numbers)| line_of(numbers)).collect());
    let lines: Vec<Vec<String>> = std::iter::once(names).chain(lines).collect();
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or_default();
    let widths: Vec<usize> = (0..first.len()).map(width).collect();
    for line in &lines {
        for (cell, width) in line.iter().zip(&widths) {
            write!(out, "  {cell:>width$}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Nanoseconds as seconds with all digits.
fn in_seconds(nanos: i64) -> String {
    let sign = if nanos < 0 { "-" } else { "" };
    let nanos = nanos.unsigned_abs();
    format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)
}

fn line_of(numbers: &[Number]) -> String {
    let shown: Vec<String> = numbers.iter().take(MAX_NUMBERS).map(Number::to_string).collect();
    let rest = if numbers.len() > MAX_NUMBERS { format!(" … ({})", numbers.len()) } else { String::new() };
    shown.join(" ") + &rest
}

fn json(out: &mut String, topic: &str, parts: &Parts<'_>) -> std::fmt::Result {
    let envelope = parts.envelope;
    write!(
        out,
        "{{\"topic\":{},\"seq\":{},\"stamp\":{},\"tick\":{},\"len\":{},\"missed\":{},\"header\":",
        quoted(topic),
        envelope.seq,
        envelope.stamp,
        envelope.tick,
        envelope.len,
        parts.missed
    )?;
    json_object(out, &parts.header)?;
    write!(out, ",\"rows\":[")?;
    for (index, row) in parts.rows.iter().enumerate() {
        if index > 0 {
            out.push(',');
        }
        json_object(out, row)?;
    }
    writeln!(out, "]}}")
}

fn json_object(out: &mut String, fields: &[(&str, Vec<Number>)]) -> std::fmt::Result {
    out.push('{');
    for (index, (name, numbers)) in fields.iter().enumerate() {
        let comma = if index > 0 { "," } else { "" };
        let numbers: Vec<String> = numbers.iter().map(|number| number.json()).collect();
        let value = if let [single] = &numbers[..] { single.clone() } else { format!("[{}]", numbers.join(",")) };
        write!(out, "{comma}{}:{value}", quoted(name))?;
    }
    out.push('}');
    Ok(())
}

fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn csv(out: &mut String, parts: &Parts<'_>) -> std::fmt::Result {
    let Envelope { seq, stamp, tick, .. } = parts.envelope;
    for (index, row) in parts.rows.iter().enumerate() {
        write!(out, "{seq},{stamp},{tick},{index}")?;
        for number in row.iter().flat_map(|(_, numbers)| numbers) {
            write!(out, ",{number}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{SweepHeader, SweepPoint, SweepTopic, pod};

    fn written(fields: &[&str], max_rows: usize, format: Format) -> String {
        let names: Vec<String> = fields.iter().map(|name| (*name).to_owned()).collect();
        let message_text =
            MessageText::new(ByteTable::of::<SweepTopic>(), &names, max_rows, format).expect("known fields");
        let envelope = Envelope { seq: 7, stamp: -1_500_000_000, tick: 9, len: 3, ..Envelope::default() };
        let header = SweepHeader { n_rings: 32, ..SweepHeader::default() };
        let point = |x, ring| SweepPoint { x, ring, ..SweepPoint::default() };
        let rows = [point(0.1, 1), point(f32::NAN, 2), point(-2.0, 31)];
        let bytes = pod::bytes_from_rows(std::slice::from_ref(&header));
        let text = message_text.write(&envelope, bytes, pod::bytes_from_rows(&rows), 2).expect("decodes");
        message_text.title() + &text
    }

    #[test]
    fn message_is_written_in_three_formats() {
        assert_eq!(
            written(&["x", "ring", "n_rings"], 2, Format::Text),
            "(2 messages missed)\nsweep  seq 7  stamp -1.500000000  tick 9  rows 3\n  n_rings: 32\n    \
             x  ring\n  0.1     1\n  NaN     2\n"
        );
        assert_eq!(
            written(&["x", "ring", "n_rings"], 2, Format::Json),
            "{\"topic\":\"sweep\",\"seq\":7,\"stamp\":-1500000000,\"tick\":9,\"len\":3,\"missed\":2,\
             \"header\":{\"n_rings\":32},\"rows\":[{\"x\":0.1,\"ring\":1},{\"x\":null,\"ring\":2}]}\n"
        );
        assert_eq!(
            written(&["x"], 9, Format::Csv),
            "seq,stamp,tick,row,x\n7,-1500000000,9,0,0.1\n7,-1500000000,9,1,NaN\n7,-1500000000,9,2,-2\n"
        );
    }

    #[test]
    fn no_names_select_all_fields() {
        let text = written(&[], 1, Format::Json);
        let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(value["header"].as_object().map(serde_json::Map::len), Some(5));
        assert_eq!(value["rows"][0].as_object().map(serde_json::Map::len), Some(7));
    }

    #[test]
    fn unknown_field_is_reported_with_the_known_ones() {
        let names = ["y".to_owned(), "color".to_owned()];
        let error = MessageText::new(ByteTable::of::<SweepTopic>(), &names, 1, Format::Text).err().expect("refused");
        let error = error.to_string();
        assert!(error.contains("no field color") && error.contains("x, y, z"), "{error}");
    }
}
