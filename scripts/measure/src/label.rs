//! Names of rows, made from the settings that they are rendered with: a preset that changes changes them too.

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

use crate::engine::{Engine, QUALITIES, title};

/// The template with each `{path}` or `{path km}` replaced by that setting's value, of what `headless --effective` says.
pub fn fill(template: &str, effective: &Value) -> Result<String> {
    let mut text = String::new();
    let mut rest = template;
    while let Some((before, after)) = rest.split_once('{') {
        let (inside, after) = after.split_once('}').with_context(|| format!("{template}: a brace is left open"))?;
        let (path, unit) = inside.split_once(' ').map_or((inside, None), |(path, unit)| (path, Some(unit)));
        text += before;
        text += &shown(value_at(effective, path)?, unit).with_context(|| format!("{template}: {inside}"))?;
        rest = after;
    }
    Ok(text + rest)
}

fn value_at<'a>(effective: &'a Value, path: &str) -> Result<&'a Value> {
    let found = path.split('.').try_fold(effective, |value, part| value.get(part));
    found.with_context(|| format!("headless --effective: there is no {path}"))
}

fn shown(value: &Value, unit: Option<&str>) -> Result<String> {
    Ok(match (value, unit) {
        (Value::Number(number), None) => number.as_f64().context("not a number")?.to_string(),
        (Value::Number(number), Some("km")) => format!("{} km", number.as_f64().context("not a number")? / 1000.0),
        (Value::String(text), None) => text.to_lowercase(),
        _ => bail!("only numbers and names can be shown, and only km as their unit"),
    })
}

/// Which quality presets are what.
pub struct Presets {
    /// Name, and all that it amounts to.
    all: Vec<(&'static str, Value)>,
    default: Option<&'static str>,
}

impl Presets {
    /// Asks the renderer.
    pub fn of(engine: &Engine) -> Result<Self> {
        let all = QUALITIES.into_iter().map(|name| Ok((name, engine.effective(&format!("--quality {name}"))?)));
        Ok(Self { all: all.collect::<Result<_>>()?, default: engine.quality_preset(None)? })
    }

    /// A preset's title, which says if it is the default.
    pub fn title(&self, name: &str) -> String {
        if self.default == Some(name) { format!("{} (default)", title(name)) } else { title(name) }
    }

    /// Whose settings of these paths a picture has, in brackets; nothing where no preset's.
    pub fn with_the_same(&self, effective: &Value, settings: &[&str]) -> Result<String> {
        let paths: Vec<&str> = settings.iter().filter_map(|setting| Some(setting.split_once('=')?.0)).collect();
        let mut owners = Vec::new();
        for (name, own) in &self.all {
            let same = paths.iter().map(|path| Ok(value_at(effective, path)? == value_at(own, path)?));
            if same.collect::<Result<Vec<_>>>()?.into_iter().all(|same| same) {
                owners.push(format!("{}'s", title(name)));
            }
        }
        Ok(match owners.len() {
            0 => String::new(),
            n if n == self.all.len() => " (all presets')".to_owned(),
            _ => format!(" ({})", owners.join(", ")),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn labels_follow_the_settings() {
        let effective = json!({ "quality": { "step": 60.0, "max_distance": 90000.0, "resolution": "Half" } });
        let filled = |template| fill(template, &effective).unwrap();
        assert_eq!(filled("High, step {quality.step} m"), "High, step 60 m");
        assert_eq!(filled("{quality.max_distance km}, {quality.resolution} resolution"), "90 km, half resolution");
        assert_eq!(filled("no number"), "no number");
        for wrong in ["{quality.stride}", "{quality.step", "{quality.resolution km}", "{quality}"] {
            assert!(fill(wrong, &effective).is_err(), "{wrong}");
        }
    }

    #[test]
    fn presets_are_named_where_they_share_all_that_was_set() {
        let of = |stop: f64, steps: u32| json!({ "quality": { "transmittance_stop": stop, "light_steps": steps } });
        let all = vec![("low", of(0.02, 6)), ("high", of(0.02, 6)), ("ultra", of(0.005, 6))];
        let presets = Presets { all, default: Some("high") };
        let stop = ["quality.transmittance_stop=0.02"];
        let same = |effective: &Value, settings: &[&str]| presets.with_the_same(effective, settings).unwrap();
        assert_eq!(same(&of(0.02, 6), &stop), " (Low's, High's)");
        assert_eq!(same(&of(0.02, 6), &["quality.light_steps=6"]), " (all presets')");
        assert_eq!(same(&of(0.075, 6), &stop), "");
        assert_eq!((presets.title("high"), presets.title("low")), ("High (default)".to_owned(), "Low".to_owned()));
    }
}
