from hil.app.campaign.folders.answers import Answer
from collections.abc import Sequence


def page_html(answers: Sequence[Answer]) -> str:
    return ""
