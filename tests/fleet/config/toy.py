"""An adapter for the tests of fleet.yaml: installed in most of them, a drop-in file in some."""

from typing import Literal

from pydantic import Field, SecretStr

from fleet import AdapterConfig, FrameAdapter


class ToyConfig(AdapterConfig):
    adapter: Literal["toy"]
    link: str = Field(description="Where the toy is.")
    system_id: int = Field(1, ge=1, le=255, description="The toy's number.")
    armed: bool = Field(False, description="Whether it is armed.")
    pace: Literal["slow", "fast"] = Field("slow", description="How fast it goes.")
    pin: SecretStr | None = Field(None, description="Its secret.")

    def identity(self):
        return f"{self.link}#{self.system_id}"


class Toy(FrameAdapter[ToyConfig]):
    Config = ToyConfig

    def decode(self, frame, stamp):
        return ()

    def halt(self):
        return (b"halt",)
