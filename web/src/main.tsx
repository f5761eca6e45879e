import "uplot/dist/uPlot.min.css";
import "./styles/page.css";

import { type ComponentType, render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { car, isMeasured, model, vehicle } from "./state/car";
import { chooseLink, startPage } from "./state/catalogue";
import { keepLate } from "./state/answer";
import { keepWays } from "./state/charging";
import { keepDriving } from "./state/drive";
import { keepForecasting } from "./state/forecast";
import { keepReach } from "./state/journey";
import { keepOnRoad, openFromAddress } from "./state/live-drive";
import { keepLink } from "./state/link";
import { keepAdvice } from "./state/advice";
import { keepNeed } from "./state/need";
import { isOpen, labelOf } from "./state/own-cars";
import { keepPosition } from "./state/position";
import { keepLanguage, keepPreferences, text } from "./state/preferences";
import { AdviceCard } from "./ui/advice";
import { Announcer } from "./ui/announcer";
import { Chips } from "./ui/chips";
import { ConditionsPanel } from "./ui/conditions-panel";
import { Details } from "./ui/details";
import { Glance } from "./ui/glance";
import { Header } from "./ui/header";
import { JourneyAnswer } from "./ui/journey-answer";
import { MapCard } from "./ui/map-card";
import { Result } from "./ui/result";
import { CarDialog } from "./ui/car-dialog";
import { LiveDrive } from "./ui/live-drive";
import { connectTokenDialog, TokenDialog } from "./ui/token-dialog";
import { TripPanel } from "./ui/trip-panel";
import { VerdictCard } from "./ui/verdict";

function Foot() {
  const learned = model.value?.model;
  const { foot } = text.value;
  const { own, title = "" } = car.value ?? {};
  return (
    <footer>
      {own && (
        <p>
          {foot.ownCar(labelOf(own), title)} {foot.caution}
        </p>
      )}
      {!own && learned && (
        <p>
          {isMeasured.value
            ? `${learned.car_title}. ${foot.model(learned.trips)}`
            : `${foot.published(vehicle.value?.title ?? car.value?.title ?? "")} ${foot.modelOfCar(learned.trips, learned.car_title)}`}{" "}
          {foot.caution}
        </p>
      )}
      <p>
        <a href="openapi.json">{foot.openapi}</a> <a href="licences.txt">{foot.licences}</a>
      </p>
    </footer>
  );
}

/** The dialog of the user's cars; it is loaded when it is first opened. */
function OwnCars() {
  const [loaded, setLoaded] = useState<{ Dialog: ComponentType } | null>(null);
  useEffect(() => {
    if (!isOpen.value) return;
    void import("./ui/own-cars-dialog").then(({ OwnCarsDialog }) => setLoaded({ Dialog: OwnCarsDialog }));
  }, [isOpen.value]);
  return loaded && <loaded.Dialog />;
}

function Page() {
  return (
    <>
      <a class="skip" href="#content">
        {text.value.skip}
      </a>
      <Header />
      <main id="content">
        <div class="asked">
          <TripPanel />
          <ConditionsPanel />
        </div>
        <div class="answered">
          <Chips />
          <VerdictCard />
          <MapCard />
          <JourneyAnswer />
          <AdviceCard />
          <Result />
          <Details />
        </div>
      </main>
      <Foot />
      <Glance />
      <Announcer />
      <CarDialog />
      <OwnCars />
      <LiveDrive />
      <TokenDialog />
    </>
  );
}

connectTokenDialog();
await keepLanguage();
keepPreferences();
keepForecasting();
keepDriving();
keepOnRoad();
keepPosition();
keepReach();
keepNeed();
keepLate();
keepWays();
keepAdvice();
openFromAddress();
keepLink((linked) => void chooseLink(linked));
render(<Page />, document.body);
void startPage();
