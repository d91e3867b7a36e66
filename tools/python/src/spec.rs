//! Description of a stage by its Python class, as JSON: names and settings.

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value};
use settings::nearest_key;
use settings::run_time_words::{each_one_of, one_of};
use stage::toml::Spanned;
use stage::toml::de::{DeTable, DeValue};
use stage::{Field, Problem, Rule};

/// Description of a stage without values of its settings.
#[derive(Debug, Deserialize)]
pub struct Spec {
    /// Table of the stage in the launch file.
    pub name: String,
    pub inputs: Vec<String>,
    pub optional_inputs: Vec<String>,
    pub outputs: Vec<String>,
    pub settings: Vec<Setting>,
}

/// One setting: its default gives the type.
#[derive(Debug, Deserialize)]
pub struct Setting {
    pub key: String,
    default: Value,
    meaning: String,
    within: Option<[f64; 2]>,
    at_least: Option<f64>,
    one_of: Option<Vec<String>>,
}

impl Setting {
    /// The setting in the form of `--describe`.
    pub fn field(&self) -> Field {
        let (kind, rule) = match &self.default {
            Value::Bool(_) => ("bool", String::new()),
            Value::Number(number) if number.is_f64() => ("f64", self.float_rule().text()),
            Value::Number(_) => ("i64", self.integer_rule().text()),
            Value::Array(_) if self.has_numbers() => ("Vec<f64>", String::new()),
            Value::Array(_) => ("Vec<String>", self.texts_rule().text()),
            _ => ("String", self.text_rule().text()),
        };
        Field {
            key: self.key.clone(),
            kind: kind.to_owned(),
            default: self.default.to_string(),
            rule,
            meaning: self.meaning.clone(),
        }
    }

    /// The value that a launch file sets, as JSON, or its problem.
    pub fn read(&self, value: Spanned<DeValue<'_>>) -> Result<Value, String> {
        match &self.default {
            Value::Bool(_) => json(value, &*any::<bool>()),
            Value::Number(number) if number.is_f64() => json(value, &*self.float_rule()),
            Value::Number(_) => json(value, &*self.integer_rule()),
            Value::Array(_) if self.has_numbers() => json(value, &*any::<Vec<f64>>()),
            Value::Array(_) => json(value, &*self.texts_rule()),
            _ => json(value, &*self.text_rule()),
        }
    }

    fn has_numbers(&self) -> bool {
        self.default.as_array().is_some_and(|values| values.iter().any(Value::is_number))
    }

    fn float_rule(&self) -> Box<dyn Rule<f64>> {
        match (self.within, self.at_least) {
            (Some([low, high]), _) => Box::new(stage::within(low, high)),
            (_, Some(low)) => Box::new(stage::at_least(low)),
            _ => any(),
        }
    }

    fn integer_rule(&self) -> Box<dyn Rule<i64>> {
        match (self.within, self.at_least) {
            (Some([low, high]), _) => Box::new(stage::within(low.ceil() as i64, high.floor() as i64)),
            (_, Some(low)) => Box::new(stage::at_least(low.ceil() as i64)),
            _ => any(),
        }
    }

    fn text_rule(&self) -> Box<dyn Rule<String>> {
        match self.words() {
            Some(words) => Box::new(one_of(words)),
            None => any(),
        }
    }

    fn texts_rule(&self) -> Box<dyn Rule<Vec<String>>> {
        match self.words() {
            Some(words) => Box::new(each_one_of(words)),
            None => any(),
        }
    }

    /// The allowed words. They are leaked: a process has one stage, whose rules live as long as the process.
    fn words(&self) -> Option<&'static [&'static str]> {
        let words = self.one_of.as_ref()?.iter().map(|word| &*word.clone().leak());
        Some(words.collect::<Vec<_>>().leak())
    }
}

fn any<T: 'static>() -> Box<dyn Rule<T>> {
    Box::new(stage::any())
}

fn json<T: DeserializeOwned + Serialize>(value: Spanned<DeValue<'_>>, rule: &dyn Rule<T>) -> Result<Value, String> {
    let value = rule.read(value).map_err(|error| error.to_string())?;
    serde_json::to_value(value).map_err(|error| error.to_string())
}

impl Spec {
    /// The valid values that a table sets, and the problems of the others.
    pub fn read(&self, table: &DeTable<'_>) -> (Map<String, Value>, Vec<Problem>) {
        let mut values = Map::new();
        let mut problems = Vec::new();
        for (key, value) in table {
            let name = key.get_ref().as_ref();
            let problem = |span, text| Problem { key: name.to_owned(), span: Some(span), text };
            match self.settings.iter().find(|setting| setting.key == name).map(|setting| setting.read(value.clone())) {
                Some(Ok(value)) => drop(values.insert(name.to_owned(), value)),
                Some(Err(text)) => problems.push(problem(value.span(), text)),
                None => {
                    let known = self.settings.iter().map(|setting| setting.key.as_str());
                    problems.push(problem(key.span(), nearest_key(name, known)));
                }
            }
        }
        (values, problems)
    }
}
