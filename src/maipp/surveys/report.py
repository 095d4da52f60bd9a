"""The interactive report of a planned survey: its record with the names, places and units of the mission file."""

from datetime import date

from maipp.surveys.expected_mission import ExpectedSurvey
from maipp.surveys.standardise import PreparedSurvey
from maipp.viz.report_survey import SurveyReport

_EXPECTED = (
    "Planned, not measured: the maps show what is expected before the survey, and how uncertain it will be at each "
    "moment. Measured values will change the routes if robots replan."
)


def survey_report(prepared: PreparedSurvey, expected: ExpectedSurvey) -> SurveyReport:
    """What `maipp.viz.report.write_report` makes a page of."""
    survey, frame = prepared.survey, prepared.frame
    has_prior = len(prepared.prior_y) > 0
    return SurveyReport(
        expected.episode,
        title=survey.name,
        date=date.today().isoformat(),
        names=prepared.names,
        seconds_per_time=prepared.seconds_per_time,
        area=prepared.area,
        no_go=prepared.no_go,
        prior_x=frame.to_user(prepared.prior_x) if has_prior else None,
        prior_y=frame.to_user_values(prepared.prior_y) if has_prior else None,
        truth_known=False,
        broadcasts=expected.broadcasts,
        warnings=(_EXPECTED, *prepared.warnings),
    )
