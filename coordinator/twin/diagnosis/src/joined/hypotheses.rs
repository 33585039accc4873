//! Hypotheses of a long track, from those of its sections.

use super::{DiagnosedSection, Whole};
use crate::estimate::Estimate;
use crate::outcome::{Hypothesis, Location, meet};
use tracktwin_track::extension::{Kind, PlaceKind};

/// A hypothesis of a section.
struct Found {
    section: usize,
    hypothesis: Hypothesis,
}

impl Whole<'_> {
    /// The hypotheses of all sections, each finding once.
    pub(super) fn hypotheses(&self) -> Vec<Hypothesis> {
        let mut found: Vec<Found> = Vec::new();
        for (section, diagnosed) in self.sections.iter().enumerate() {
            let placed = |hypothesis: &Hypothesis| self.placed(section, hypothesis.clone());
            let all = diagnosed.diagnosis.hypotheses.iter().map(placed);
            let all = all.filter(|it| !self.is_of_another(section, it));
            found.extend(all.map(|hypothesis| Found { section, hypothesis }));
        }
        let kept = found.iter().filter(|one| !found.iter().any(|other| self.replaces(other, one)));
        let mut joined: Vec<Hypothesis> = Vec::new();
        for Found { hypothesis, .. } in kept {
            match joined.iter_mut().find(|known| self.continues(known, hypothesis)) {
                Some(known) => self.extend(known, hypothesis),
                None => joined.push(hypothesis.clone()),
            }
        }
        joined
    }

    /// Whether a hypothesis lies beyond the sleepers of its section and at those of another one. Passes reach a few
    /// spans beyond a section.
    fn is_of_another(&self, section: usize, hypothesis: &Hypothesis) -> bool {
        let Some(place) = &hypothesis.location else { return false };
        let nearest = |x_m: f64| {
            let distance = |index: &usize| (self.x_m[*index] - x_m).abs();
            (0..self.x_m.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
        };
        let [Some(first), Some(last)] = place.x_m.map(nearest) else { return false };
        let holds = |it: &DiagnosedSection| it.sleepers.start <= last && first < it.sleepers.end;
        !holds(&self.sections[section]) && self.sections.iter().any(holds)
    }

    /// A hypothesis on all sleepers of a section refers to the section's own sleepers.
    fn placed(&self, section: usize, mut hypothesis: Hypothesis) -> Hypothesis {
        let compared = self.sections[section].diagnosis.track.len();
        let is_placed = match Kind::from_name(&hypothesis.physics) {
            Some(kind) => kind.place == PlaceKind::Sleepers,
            None => hypothesis.port.as_deref() == Some("rail_seat"),
        };
        let is_everywhere =
            hypothesis.location.as_ref().is_none_or(|it| it.sleepers.len() == compared);
        let own = self.own(section);
        if let [first, .., last] = own[..]
            && is_placed
            && is_everywhere
        {
            hypothesis.location = Some(Location {
                x_m: [self.x_m[first], self.x_m[last]],
                sleepers: own.iter().map(|&sleeper| self.ids[sleeper].clone()).collect(),
            });
        }
        hypothesis
    }

    /// Whether the finding of another section replaces a hypothesis: both sections contain its place, and
    /// the other section contains it farther from the ends.
    fn replaces(&self, other: &Found, one: &Found) -> bool {
        let (Some(place), Some(elsewhere)) = (&one.hypothesis.location, &other.hypothesis.location)
        else {
            return false;
        };
        let is_inside = |place: &Location, section: usize| {
            let contains =
                |id| self.index(id).is_some_and(|it| self.sections[section].sleepers.contains(&it));
            place.sleepers.iter().all(contains)
        };
        let owned = |section: usize| {
            let owners = place.sleepers.iter().map(|id| self.owner(self.index(id)?));
            owners.filter(|owner| *owner == Some(section)).count()
        };
        other.section != one.section
            && other.hypothesis.accepted
            && is_inside(place, other.section)
            && is_inside(elsewhere, one.section)
            && meet(Some(place), Some(elsewhere))
            && owned(other.section) > owned(one.section)
    }

    /// Whether two accepted hypotheses are one finding that continues in the next section.
    fn continues(&self, known: &Hypothesis, other: &Hypothesis) -> bool {
        if known.physics != other.physics || known.port != other.port || !known.accepted {
            return false;
        }
        let (Some(place), Some(further)) = (&known.location, &other.location) else {
            return known.location.is_none() && other.location.is_none();
        };
        let indices = |it: &Location| -> Vec<usize> {
            it.sleepers.iter().filter_map(|id| self.index(id)).collect()
        };
        let (place, further) = (indices(place), indices(further));
        let (Some(&start), Some(&first)) = (place.first(), further.first()) else { return false };
        let step = |of: &[usize]| of.windows(2).map(|pair| pair[1] - pair[0]).max();
        let step = step(&place).max(step(&further)).unwrap_or(0);
        let is_there =
            |last: Option<&usize>, first: usize| last.is_some_and(|it| first <= it + step);
        other.accepted && is_there(place.last(), first) && is_there(further.last(), start)
    }

    /// Adds a hypothesis of the next section to a known one.
    fn extend(&self, known: &mut Hypothesis, other: &Hypothesis) {
        known.probability = known.probability.max(other.probability);
        known.family_probability = known.family_probability.max(other.family_probability);
        known.detectability = known.detectability.hypot(other.detectability);
        known.log_evidence += other.log_evidence;
        let kind = Kind::from_name(&known.physics);
        for (name, estimate) in &mut known.parameters {
            if let Some(further) = other.parameters.get(name) {
                let form =
                    kind.and_then(|kind| kind.parameter(name)).map_or(0.0, |it| it.form_deviation);
                *estimate = mean_of_one_form(*estimate, *further, form);
            }
        }
        let (Some(place), Some(further)) = (&mut known.location, &other.location) else { return };
        place.x_m = [place.x_m[0].min(further.x_m[0]), place.x_m[1].max(further.x_m[1])];
        let is_there = |id: &&String| place.sleepers.contains(id) || further.sleepers.contains(id);
        place.sleepers = self.ids.iter().filter(is_there).cloned().collect();
    }
}

/// Mean of two estimates of one shape whose unknown form gives both the same relative deviation `form`.
fn mean_of_one_form(one: Estimate, other: Estimate, form: f64) -> Estimate {
    let alone = |it: Estimate| {
        let variance = it.sd.powi(2) - (form * it.mean).powi(2);
        Estimate { sd: variance.max(0.0).sqrt(), ..it }
    };
    let joined = mean(alone(one), alone(other));
    Estimate { sd: joined.sd.hypot(form * joined.mean), ..joined }
}

/// Mean of two estimates. Where they differ by more than their deviations, both are weighted with the variance between
/// them as well: a wrong one that is sure of itself does not win (random effects, `DerSimonian` & Laird 1986, Controlled
/// Clinical Trials 7).
pub(super) fn mean(one: Estimate, other: Estimate) -> Estimate {
    // An exact value, such as the number of an order, stays.
    if let Some(exact) = [one, other].into_iter().find(|it| it.sd == 0.0) {
        return exact;
    }
    let [a, b] = [one, other].map(|it| it.sd.powi(2));
    let between = (0.5 * ((one.mean - other.mean).powi(2) - a - b)).max(0.0);
    let [a, b] = [a, b].map(|it| (it + between).recip());
    let mean = (a * one.mean + b * other.mean) / (a + b);
    Estimate { mean, sd: (a + b).recip().sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_sections_that_disagree_neither_wins_and_their_difference_is_stated() {
        let joined = mean(Estimate { mean: 35.0, sd: 2.3 }, Estimate { mean: 10.0, sd: 0.3 });
        assert!((joined.mean - 22.5).abs() < 0.2 && (joined.sd - 12.5).abs() < 0.2, "{joined:?}");
        let alike = mean(Estimate { mean: 35.0, sd: 2.0 }, Estimate { mean: 34.0, sd: 1.0 });
        assert!((alike.mean - 34.2).abs() < 1e-9 && (alike.sd - 0.8_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn two_sections_know_the_form_of_a_shape_no_better_than_one() {
        let [one, other] = [10.0, 10.0].map(|mean| Estimate { mean, sd: 2.5 });
        assert!((mean(one, other).sd - 2.5 / 2f64.sqrt()).abs() < 1e-12);
        // Of 2.5, 1.5 is the fit's and 2 the form's.
        let joined = mean_of_one_form(one, other, 0.2);
        assert!((joined.sd - (1.5 / 2f64.sqrt()).hypot(2.0)).abs() < 1e-12, "{joined:?}");
        assert!((joined.mean - 10.0).abs() < 1e-12);
    }
}
