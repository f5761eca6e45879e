import "uplot/dist/uPlot.min.css";
import "./styles/page.css";

import { render } from "preact";
import { isMeasured, model, vehicle } from "./state/car";
import { begin, keepRemembering } from "./state/catalogue";
import { keepDriving } from "./state/drive";
import { keepForecasting } from "./state/forecast";
import { keepPointing } from "./state/pointer";
import { keepPreferences } from "./state/preferences";
import { Announcer } from "./ui/announcer";
import { ConditionsPanel } from "./ui/conditions-panel";
import { Details } from "./ui/details";
import { Glance } from "./ui/glance";
import { Header } from "./ui/header";
import { Result } from "./ui/result";
import { askHere, TokenDialog } from "./ui/token-dialog";
import { TripPanel } from "./ui/trip-panel";

function Foot() {
  const used = model.value;
  const learned = used && `model ${used.name}, learned from ${used.model.trips} trips`;
  return (
    <footer>
      {used && (
        <p>
          {isMeasured.value
            ? `${used.model.vehicle_title}, ${learned}.`
            : `${vehicle.value?.title} by its book values; ${learned} of a ${used.model.vehicle_title}.`}{" "}
          A forecast is no promise: drive with a reserve.
        </p>
      )}
      <p>
        <a href="openapi.json">For developers: OpenAPI</a> <a href="licences.txt">Licences</a>
      </p>
    </footer>
  );
}

function Page() {
  return (
    <>
      <a class="skip" href="#content">
        To the forecast
      </a>
      <Header />
      <main id="content">
        <TripPanel />
        <Result />
        <ConditionsPanel />
        <Details />
      </main>
      <Foot />
      <Glance />
      <Announcer />
      <TokenDialog />
    </>
  );
}

askHere();
keepPreferences();
keepForecasting();
keepDriving();
keepPointing();
keepRemembering();
render(<Page />, document.body);
void begin();
