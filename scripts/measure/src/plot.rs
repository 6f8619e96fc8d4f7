//! Line plots as SVG.

use std::path::Path;

use anyhow::{Result, anyhow};
use plotters::{
    coord::{
        Shift,
        ranged1d::{AsRangedCoord, ValueFormatter},
    },
    prelude::*,
};

pub struct Plot<'a> {
    pub title: &'a str,
    pub x: &'a str,
    pub y: &'a str,
    pub series: Vec<Series>,
}

pub struct Series {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

const SIZE: (u32, u32) = (640, 400);
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 119, 180), RGBColor(214, 39, 40), RGBColor(44, 160, 44), RGBColor(120, 120, 120)];
const FONT: &str = "sans-serif";

impl Plot<'_> {
    /// Both axes logarithmic: a straight line of slope 1 is a cost in proportion. Values have to be above 0.
    pub fn write_log(&self, path: &Path) -> Result<()> {
        let [x, y] = self.ranges(1.25)?;
        let root = SVGBackend::new(path, SIZE).into_drawing_area();
        self.draw(&root, (x.0..x.1).log_scale(), (y.0..y.1).log_scale(), SeriesLabelPosition::UpperLeft)
            .map_err(|e| failed(path, &e))
    }

    /// Only the vertical axis logarithmic.
    pub fn write_log_y(&self, path: &Path) -> Result<()> {
        let [_, y] = self.ranges(1.6)?;
        let xs = || self.series.iter().flat_map(|s| s.points.iter().map(|p| p.0));
        let x = (xs().fold(f64::MAX, f64::min) - 0.2)..(xs().fold(f64::MIN, f64::max) + 0.2);
        let root = SVGBackend::new(path, SIZE).into_drawing_area();
        self.draw(&root, x, (y.0..y.1).log_scale(), SeriesLabelPosition::LowerLeft).map_err(|e| failed(path, &e))
    }

    /// Least and largest of both coordinates, apart by some room.
    fn ranges(&self, room: f64) -> Result<[(f64, f64); 2]> {
        let all = || self.series.iter().flat_map(|series| &series.points);
        let range = |get: fn(&(f64, f64)) -> f64| {
            let (low, high) = all().map(get).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            (low > 0.0 && low <= high).then_some((low / room, high * room))
        };
        match (range(|p| p.0), range(|p| p.1)) {
            (Some(x), Some(y)) => Ok([x, y]),
            _ => Err(anyhow!("{}: nothing to plot, or values that are not above 0", self.title)),
        }
    }

    fn draw<'a, X, Y>(
        &self,
        root: &DrawingArea<SVGBackend<'a>, Shift>,
        x: X,
        y: Y,
        legend: SeriesLabelPosition,
    ) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
        Y::CoordDescType: ValueFormatter<f64> + Ranged<ValueType = f64>,
    {
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(root)
            .caption(self.title, (FONT, 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .x_desc(self.x)
            .y_desc(self.y)
            .label_style((FONT, 13))
            .light_line_style(RGBColor(238, 238, 238))
            .bold_line_style(RGBColor(215, 215, 215))
            .x_label_formatter(&plain)
            .y_label_formatter(&plain)
            .draw()?;
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            let line = LineSeries::new(series.points.iter().copied(), colour.stroke_width(2)).point_size(3);
            chart
                .draw_series(line)?
                .label(&series.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(legend)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(215, 215, 215))
            .label_font((FONT, 13))
            .draw()?;
        root.present()
    }
}

fn plain(value: &f64) -> String {
    if *value >= 1e4 { format!("{:.0}k", value / 1e3) } else { format!("{}", (value * 1e4).round() / 1e4) }
}

fn failed(path: &Path, error: &dyn std::error::Error) -> anyhow::Error {
    anyhow!("cannot write {}: {error}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_holds_its_series_and_refuses_zero() {
        let path = std::env::temp_dir().join(format!("cumulus_measure_plot_{}.svg", std::process::id()));
        let of = |y| Plot {
            title: "title",
            x: "steps",
            y: "ms",
            series: vec![Series { name: "first of all".into(), points: vec![(8.0, 1.0), (16.0, y)] }],
        };
        of(2.0).write_log(&path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        assert!(text.contains("first of all") && text.contains("<polyline"), "{text}");
        assert!(of(0.0).write_log(&path).is_err());
    }
}
